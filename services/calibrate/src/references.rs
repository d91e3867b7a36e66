//! The mosaic cameras of a drive, ready to make cubes.

use drive::manifest::MosaicEntry;
use formats::sensor_calibration::SensorCalibration;
use messages::{CubeHeader, CubeTopic, MAX_CUBE_BANDS, Message, MosaicHeader};
use spectral::{CameraError, Demosaicing, FrameCounts, FullResolution, SpectralError};
use std::path::Path;

/// A camera that cannot give cubes.
#[derive(Debug, thiserror::Error)]
pub enum CubeCameraError {
    #[error(transparent)]
    Camera(#[from] CameraError),
    #[error("{camera}: {source}")]
    Demosaicing { camera: String, source: SpectralError },
    #[error("{camera}: a cube has {n_rows} words; at most {max} are allowed: set calibrate.demosaic = \"bin\"")]
    Size { camera: String, n_rows: usize, max: usize },
}

/// A mosaic camera with its references, and the layout of its cubes.
pub struct CubeCamera {
    /// References and correction.
    pub spectral: spectral::Camera,
    header: CubeHeader,
    full: Option<FullResolution>,
}

impl CubeCamera {
    /// Reads the references of the drive's mosaic camera `index`. Its cubes are corrected by the matrix of `sensor`, and have full
    /// resolution with a demosaicing method.
    pub fn read(
        drive: &Path,
        index: usize,
        entry: &MosaicEntry,
        sensor: Option<&SensorCalibration>,
        demosaicing: Option<Demosaicing>,
    ) -> Result<Self, CubeCameraError> {
        let spectral = spectral::Camera::read(drive, entry, sensor)?;
        let full = demosaicing.map(|method| FullResolution::new(&spectral, method));
        let camera = || entry.name.clone();
        let full = full.transpose().map_err(|source| CubeCameraError::Demosaicing { camera: camera(), source })?;
        let mut header = cube_header(index, &spectral);
        if full.is_some() {
            header.width *= header.pattern;
            header.height *= header.pattern;
            header.pattern = 1;
        }
        // In addition to the bands: the mask and, with color lines, the region.
        let n_rows = (header.n_bands as usize + 2) * header.width as usize * header.height as usize;
        if n_rows > CubeTopic::MAX_ROWS {
            return Err(CubeCameraError::Size { camera: camera(), n_rows, max: CubeTopic::MAX_ROWS });
        }
        Ok(Self { spectral, header, full })
    }

    /// Turns one raw frame into a cube of the size in [`Self::cube_header`].
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

    /// The header of this camera's cubes, with the exposure time of the frame.
    pub fn cube_header(&self, frame: &MosaicHeader) -> CubeHeader {
        CubeHeader { exposure_nanos: frame.exposure_nanos, ..self.header }
    }

    /// Whether the frame fits this camera.
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
    let [width, height] = mosaic.cells();
    let [x0, y0] = mosaic.origin();
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
