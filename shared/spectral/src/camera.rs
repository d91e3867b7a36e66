//! A mosaic camera of a drive with its references: the only module of this crate that reads files.

use crate::mosaic::check_length;
use crate::{Calibration, Correction, DarkReference, FrameCounts, Mosaic, Reference, SpectralError, WhitePanel};
use drive::manifest::MosaicEntry;
use formats::raw_mosaic::{RawMosaic, RawMosaicError};
use formats::sensor_calibration::{SensorCalibration, VirtualBand};
use std::path::{Path, PathBuf};

/// Reason why a camera gives no reflectance.
#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    /// The manifest entry, a reference or the correction is invalid.
    #[error("{camera}: {source}")]
    Calibration {
        /// Name of the camera.
        camera: String,
        /// The cause.
        source: SpectralError,
    },
    /// A reference frame cannot be read.
    #[error("{camera}: {source}")]
    Read {
        /// Name of the camera.
        camera: String,
        /// The cause.
        source: RawMosaicError,
    },
    /// A reference frame does not fit the camera.
    #[error("{camera}: {}: {width}x{height} px; must be {}x{}", path.display(), expected[0], expected[1])]
    Size {
        /// Name of the camera.
        camera: String,
        /// The frame.
        path: PathBuf,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Columns and rows of the camera.
        expected: [u32; 2],
    },
    /// There are more reference frames than their sum can hold.
    #[error("{camera}: {}: {source}", path.display())]
    Frame {
        /// Name of the camera.
        camera: String,
        /// The frame.
        path: PathBuf,
        /// The cause.
        source: SpectralError,
    },
    /// A folder contains no reference frames.
    #[error("{camera}: no {what} reference in {}: no reflectance", folder.display())]
    NoReference {
        /// Name of the camera.
        camera: String,
        /// Dark or white.
        what: &'static str,
        /// The searched folder.
        folder: PathBuf,
    },
}

/// References and correction of one camera.
#[derive(Clone, Debug)]
pub struct Camera {
    calibration: Calibration,
    correction: Option<Correction>,
    wavelengths_nm: Vec<f32>,
    valid_bands: u32,
}

impl Camera {
    /// Reads the references of a camera of the drive in folder `drive`: all images (PGM, TIFF) in the camera's `dark` and `white`.
    /// With a `sensor`, cubes are corrected by the sensor's reflectance matrix.
    pub fn read(drive: &Path, entry: &MosaicEntry, sensor: Option<&SensorCalibration>) -> Result<Self, CameraError> {
        let name = &entry.name;
        let named = |source: SpectralError| CameraError::Calibration { camera: name.clone(), source };
        let (width, height) = entry.model.size();
        let mosaic = Mosaic::new([width, height], entry.pattern, entry.active_area, entry.bit_depth).map_err(named)?;
        let folder = drive.join(&entry.folder);
        let darks = read_darks(name, &folder.join("dark"), entry.dark_exposure_nanos, &mosaic)?;
        let white = read_reference(name, "white", &folder.join("white"), &mosaic)?;
        let panel = entry.white_panel.as_ref();
        let reflectances = panel.and_then(|panel| panel.reflectances.clone());
        let panel = WhitePanel {
            exposure_nanos: entry.white_exposure_nanos,
            reflectances: reflectances.unwrap_or_else(|| vec![entry.white_reflectance]),
            region: panel.and_then(|panel| panel.region),
        };
        let darks: Vec<DarkReference<'_>> = darks
            .iter()
            .map(|dark| DarkReference { exposure_nanos: dark.exposure_nanos, frames: &dark.frames })
            .collect();
        let calibration = Calibration::with_panel(&mosaic, &darks, &white, &panel).map_err(named)?;
        Self::new(calibration, &entry.wavelengths_nm, sensor).map_err(named)
    }

    /// A camera with filters at the center wavelengths `filters_nm`, in the order of the pattern. With a `sensor`, cubes
    /// are corrected by the reflectance matrix of the sensor.
    pub fn new(
        calibration: Calibration,
        filters_nm: &[f64],
        sensor: Option<&SensorCalibration>,
    ) -> Result<Self, SpectralError> {
        let n_bands = calibration.mosaic().n_bands();
        check_length("wavelengths", filters_nm.len(), n_bands)?;
        let virtual_bands = sensor.and_then(SensorCalibration::reflectance_matrix).map(|matrix| &matrix.virtual_bands);
        let rows = |bands: &Vec<VirtualBand>| Correction::new(n_bands, bands.iter().map(|band| &band.coefficients[..]));
        let correction = virtual_bands.map(rows).transpose()?;
        let wavelengths_nm = match virtual_bands {
            Some(bands) => bands.iter().map(|band| band.wavelength_nm as f32).collect(),
            None => filters_nm.iter().map(|nm| *nm as f32).collect(),
        };
        let measured = calibration.valid_bands();
        let valid_bands = correction.as_ref().map_or(measured, |correction| correction.valid(measured));
        Ok(Self { calibration, correction, wavelengths_nm, valid_bands })
    }

    /// Calibration of raw samples to reflectance.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The spectral correction, if there is one.
    pub fn correction(&self) -> Option<&Correction> {
        self.correction.as_ref()
    }

    /// The filters.
    pub fn mosaic(&self) -> &Mosaic {
        self.calibration.mosaic()
    }

    /// Center wavelength of each band of the cubes, nm: of the virtual bands with a correction, otherwise of the filters.
    pub fn wavelengths_nm(&self) -> &[f32] {
        &self.wavelengths_nm
    }

    /// Bit b: band b of the cubes has at least one valid value.
    pub fn valid_bands(&self) -> u32 {
        self.valid_bands
    }

    /// Converts one raw frame into a cube, binned and corrected: `values` is band-sequential (one plane of cells for each
    /// of [`Camera::wavelengths_nm`]), bit b of a cell's mask is 1 if its band b is valid. Both are overwritten. The
    /// returned counts refer to the raw samples.
    pub fn cube_into(
        &self,
        raw: &[u16],
        exposure_nanos: u64,
        values: &mut [f32],
        masks: &mut [u32],
    ) -> Result<FrameCounts, SpectralError> {
        let Some(correction) = &self.correction else {
            return self.calibration.cube_into(raw, exposure_nanos, values, masks);
        };
        self.calibration.corrected_cube_into(raw, exposure_nanos, correction, values, masks)
    }
}

/// Mean of dark frames of an exposure time.
struct DarkFrames {
    exposure_nanos: u64,
    frames: Reference,
}

/// The dark references: from `folder` itself, and from its subfolders, which are named by an
/// exposure time in ns.
#[allow(clippy::disallowed_methods, reason = "a stage reads its calibration before its first step")]
fn read_darks(name: &str, folder: &Path, exposure_nanos: u64, mosaic: &Mosaic) -> Result<Vec<DarkFrames>, CameraError> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let others = entries.filter_map(|path| Some((path.file_name()?.to_str()?.parse::<u64>().ok()?, path)));
    let mut others: Vec<(u64, PathBuf)> = others.filter(|(_, path)| path.is_dir()).collect();
    others.sort();
    let mut darks = Vec::new();
    if others.is_empty() || !frames(folder).is_empty() {
        darks.push(DarkFrames { exposure_nanos, frames: read_reference(name, "dark", folder, mosaic)? });
    }
    for (exposure_nanos, folder) in others {
        darks.push(DarkFrames { exposure_nanos, frames: read_reference(name, "dark", &folder, mosaic)? });
    }
    Ok(darks)
}

/// The mean of all frames in a folder.
fn read_reference(name: &str, what: &'static str, folder: &Path, mosaic: &Mosaic) -> Result<Reference, CameraError> {
    let camera = || name.to_owned();
    let mut reference = Reference::new(what, mosaic);
    let expected = mosaic.size();
    for path in frames(folder) {
        let frame = RawMosaic::read(&path).map_err(|source| CameraError::Read { camera: camera(), source })?;
        let RawMosaic { width, height, .. } = frame;
        if [width, height] != expected {
            return Err(CameraError::Size { camera: camera(), path, width, height, expected });
        }
        let added = reference.add(&frame.samples);
        added.map_err(|source| CameraError::Frame { camera: camera(), path, source })?;
    }
    if reference.n_frames() == 0 {
        return Err(CameraError::NoReference { camera: camera(), what, folder: folder.to_owned() });
    }
    Ok(reference)
}

/// The images of a folder, sorted by name; empty if there is no folder.
#[allow(clippy::disallowed_methods, reason = "a stage reads its calibration before its first step")]
fn frames(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let is_image = |path: &PathBuf| path.extension().is_some_and(|e| e == "pgm" || e == "tif" || e == "tiff");
    let mut paths: Vec<PathBuf> = paths.filter(is_image).collect();
    paths.sort();
    paths
}
