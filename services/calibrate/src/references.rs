//! The cameras of a drive, and the headers of their cubes.

use formats::manifest::MosaicEntry;
use formats::sensor_calibration::SensorCalibration;
use messages::{CubeHeader, MAX_CUBE_BANDS, MosaicHeader};
use std::path::Path;

/// A mosaic camera with its references.
pub struct Camera {
    /// Ready for frames.
    pub spectral: spectral::Camera,
    header: CubeHeader,
}

impl Camera {
    /// Reads the references of the drive's mosaic camera `index`; its cubes are corrected with the matrix of `sensor`. The
    /// error is one line for the operator.
    pub fn read(
        drive: &Path,
        index: usize,
        entry: &MosaicEntry,
        sensor: Option<&SensorCalibration>,
    ) -> Result<Self, String> {
        let spectral = spectral::Camera::read(drive, entry, sensor)?;
        let header = cube_header(index, &spectral);
        Ok(Self { spectral, header })
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
