//! Cubes at full resolution: reflectance per pixel, demosaicing, correction.
//!
//! Images are processed row by row, so that only four single-channel images are in memory in addition to the cube: 22
//! bytes per pixel of the active area, 49 MB for 2045 x 1085. The cube has `n_bands` f32 and a mask for each pixel: 231
//! MB with 25 bands.

use crate::mosaic::check_length;
use crate::planes::Planes;
use crate::{Camera, Demosaicer, Demosaicing, FrameCounts, PixelReflectances, SpectralError};

/// Computes cubes of one camera and keeps its buffers.
#[derive(Debug)]
pub struct FullResolution {
    demosaicer: Demosaicer,
    method: Demosaicing,
    measured: Vec<u32>,
}

impl FullResolution {
    /// Prepares for frames of `camera`.
    pub fn new(camera: &Camera, method: Demosaicing) -> Result<Self, SpectralError> {
        let [width, height] = camera.mosaic().area();
        let demosaicer = Demosaicer::new(width, height, camera.mosaic().pattern() as usize)?;
        Ok(Self { demosaicer, method, measured: vec![0; width * height] })
    }

    /// Like [`Camera::cube_into`], with a value for each pixel in the complete cells of the active area.
    pub fn cube_into(
        &mut self,
        camera: &Camera,
        raw: &[u16],
        exposure_nanos: u64,
        values: &mut [f32],
        masks: &mut [u32],
    ) -> Result<FrameCounts, SpectralError> {
        let [width, height] = camera.mosaic().area();
        let n_pixels = width * height;
        check_length("mask", masks.len(), n_pixels)?;
        check_length("cube", values.len(), camera.wavelengths_nm().len() * n_pixels)?;
        let found = camera.calibration().reflectance(raw, exposure_nanos)?;
        let PixelReflectances { values: samples, valid, counts } = found;
        // Row-major.
        let (mut samples, _) = samples.into_raw_vec_and_offset();
        let (valid, _) = valid.into_raw_vec_and_offset();
        self.measured.fill(u32::MAX >> (32 - self.demosaicer.n_bands()));
        if counts.masked() > 0 {
            self.demosaicer.bridge_gaps(&mut samples, &valid)?;
            self.demosaicer.masks_into(&valid, &mut self.measured)?;
        }
        let mut rows = self.measured.chunks_exact(width).zip(masks.chunks_exact_mut(width)).zip((0..).step_by(width));
        let each = |bands: &[f32]| {
            let Some(((measured, masks), start)) = rows.next() else { return };
            let mut planes = Planes { values: &mut *values, stride: n_pixels, start };
            if let Some(correction) = camera.correction() {
                correction.cells_into(bands, measured, &mut planes, masks);
            } else {
                masks.copy_from_slice(measured);
                copy_measured(bands, measured, &mut planes);
            }
        };
        self.demosaicer.demosaic_rows(&samples, self.method, each)?;
        Ok(counts)
    }
}

/// Copies one row of all bands; invalid values become 0.
fn copy_measured(bands: &[f32], measured: &[u32], planes: &mut Planes<'_>) {
    for (band, row) in bands.chunks_exact(measured.len()).enumerate() {
        let plane = &mut planes.values[band * planes.stride + planes.start..][..measured.len()];
        for ((out, value), mask) in plane.iter_mut().zip(row).zip(measured) {
            *out = if mask >> band & 1 == 1 { *value } else { 0.0 };
        }
    }
}
