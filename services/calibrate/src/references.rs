//! The cameras of a drive, and the headers of their cubes.

use formats::manifest::MosaicEntry;
use formats::sensor_calibration::SensorCalibration;
use messages::{Cube, CubeHeader, MAX_CUBE_BANDS, Message, MosaicHeader};
use spectral::{Demosaicing, FrameCounts, FullResolution, SpectralError};
use std::path::Path;

/// A mosaic camera with its references.
pub struct Camera {
    /// Ready for frames.
    pub spectral: spectral::Camera,
    header: CubeHeader,
    full: Option<FullResolution>,
}

impl Camera {
    /// Reads the references of the drive's mosaic camera `index`; its cubes are corrected with the matrix of `sensor`, and
    /// have full resolution if there is a method for it. The
    /// error is one line for the operator.
    pub fn read(
        drive: &Path,
        index: usize,
        entry: &MosaicEntry,
        sensor: Option<&SensorCalibration>,
        demosaicing: Option<Demosaicing>,
    ) -> Result<Self, String> {
        let spectral = spectral::Camera::read(drive, entry, sensor)?;
        let full = demosaicing.map(|method| FullResolution::new(&spectral, method));
        let full = full.transpose().map_err(|error| format!("{}: {error}", entry.name))?;
        let mut header = cube_header(index, &spectral);
        if full.is_some() {
            (header.width, header.height) = (header.width * header.pattern, header.height * header.pattern);
            header.pattern = 1;
        }
        let n_rows = (header.n_bands as usize + 1) * header.width as usize * header.height as usize;
        if n_rows > Cube::MAX_ROWS {
            let max = Cube::MAX_ROWS;
            return Err(format!("{}: a cube of {n_rows} words; must have {max} at most", entry.name));
        }
        Ok(Self { spectral, header, full })
    }

    /// One raw frame into a cube of [`Self::cube_header`]'s size.
    pub fn cube_into(
        &mut self,
        raw: &[u16],
        exposure_nanos: u64,
        values: &mut [f32],
        masks: &mut [u32],
    ) -> Result<FrameCounts, SpectralError> {
        match &mut self.full {
            Some(full) => full.cube_into(&self.spectral, raw, exposure_nanos, values, masks),
            None => self.spectral.cube_into(raw, exposure_nanos, values, masks),
        }
    }

    /// The header of this camera's cubes; the exposure time is the frame's.
    pub fn cube_header(&self, frame: &MosaicHeader) -> CubeHeader {
        CubeHeader { exposure_nanos: frame.exposure_nanos, ..self.header }
    }

    /// Whether the frame is one of this camera.
    pub fn fits(&self, frame: &MosaicHeader) -> bool {
        let mosaic = self.spectral.mosaic();
        mosaic.size() == [frame.width, frame.height] && mosaic.bit_depth() == frame.bit_depth
    }
}

fn cube_header(index: usize, camera: &spectral::Camera) -> CubeHeader {
    let mosaic = camera.mosaic();
    let mut wavelengths_nm = [0.0; MAX_CUBE_BANDS];
    for (out, wavelength_nm) in wavelengths_nm.iter_mut().zip(camera.wavelengths_nm()) {
        *out = *wavelength_nm;
    }
    let ([width, height], [x0, y0]) = (mosaic.cells(), mosaic.origin());
    CubeHeader {
        camera: index as u32,
        width,
        height,
        n_bands: camera.wavelengths_nm().len() as u32,
        pattern: mosaic.pattern(),
        valid_bands: camera.valid_bands(),
        x0,
        y0,
        exposure_nanos: 0,
        wavelengths_nm,
    }
}
