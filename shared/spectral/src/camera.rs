//! A mosaic camera of a drive with everything that its frames need: the only place of this crate that reads files.

use crate::mosaic::check_length;
use crate::{Calibration, Correction, FrameCounts, Mosaic, Reference, SpectralError, WhitePanel};
use formats::manifest::MosaicEntry;
use formats::raw_mosaic::RawMosaic;
use formats::sensor_calibration::{SensorCalibration, VirtualBand};
use std::path::{Path, PathBuf};

/// References and correction of one camera.
#[derive(Clone, Debug)]
pub struct Camera {
    calibration: Calibration,
    correction: Option<Correction>,
    wavelengths_nm: Vec<f32>,
    valid_bands: u32,
}

impl Camera {
    /// Reads the references of a camera of the drive in folder `drive`: all images (PGM, TIFF) in the camera's `dark` and `white`. With
    /// a `sensor` its cubes are corrected by the sensor's matrix for reflectances. The error is one line for the operator.
    pub fn read(drive: &Path, entry: &MosaicEntry, sensor: Option<&SensorCalibration>) -> Result<Self, String> {
        let name = &entry.name;
        let named = |error: SpectralError| format!("{name}: {error}");
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
        let darks: Vec<(u64, &Reference)> = darks.iter().map(|(nanos, dark)| (*nanos, dark)).collect();
        let calibration = Calibration::with_panel(&mosaic, &darks, &white, &panel).map_err(named)?;
        Self::new(calibration, &entry.wavelengths_nm, sensor).map_err(named)
    }

    /// A camera whose filters have their middles at `filters_nm`, in the pattern's order. With a `sensor` its cubes are corrected
    /// by the sensor's matrix for reflectances.
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

    /// Raw samples into reflectance.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// Bands of the filters into those of the cubes, if they are corrected.
    pub fn correction(&self) -> Option<&Correction> {
        self.correction.as_ref()
    }

    /// The filters.
    pub fn mosaic(&self) -> &Mosaic {
        self.calibration.mosaic()
    }

    /// Middle of each band of the cubes, nm: of the virtual bands if they are corrected, else of the filters.
    pub fn wavelengths_nm(&self) -> &[f32] {
        &self.wavelengths_nm
    }

    /// Bit b: band b of the cubes is valid somewhere.
    pub fn valid_bands(&self) -> u32 {
        self.valid_bands
    }

    /// One raw frame into a cube, binned and corrected: `values` is band-sequential (one plane of cells for each of
    /// [`Camera::wavelengths_nm`]), bit b of a cell's mask says that its band b is valid. Both are overwritten. The counts are of
    /// the raw samples.
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

/// The dark frames with their exposure times: those in `folder` itself, and those in folders in it that are named by their
/// exposure time in ns.
fn read_darks(
    name: &str,
    folder: &Path,
    exposure_nanos: u64,
    mosaic: &Mosaic,
) -> Result<Vec<(u64, Reference)>, String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let others = entries.filter_map(|path| Some((path.file_name()?.to_str()?.parse::<u64>().ok()?, path)));
    let mut others: Vec<(u64, PathBuf)> = others.filter(|(_, path)| path.is_dir()).collect();
    others.sort();
    let mut darks = Vec::new();
    if others.is_empty() || !frames(folder).is_empty() {
        darks.push((exposure_nanos, read_reference(name, "dark", folder, mosaic)?));
    }
    for (nanos, folder) in others {
        darks.push((nanos, read_reference(name, "dark", &folder, mosaic)?));
    }
    Ok(darks)
}

/// The mean of all frames in a folder, in the order of their names.
fn read_reference(name: &str, what: &'static str, folder: &Path, mosaic: &Mosaic) -> Result<Reference, String> {
    let mut reference = Reference::new(what, mosaic);
    let [width, height] = mosaic.size();
    for path in frames(folder) {
        let about = |error: &dyn std::fmt::Display| format!("{name}: {}: {error}", path.display());
        let frame = RawMosaic::read(&path).map_err(|error| format!("{name}: {error}"))?;
        if (frame.width, frame.height) != (width, height) {
            return Err(about(&format!("{}x{} px; must be {width}x{height}", frame.width, frame.height)));
        }
        reference.add(&frame.samples).map_err(|error| about(&error))?;
    }
    if reference.n_frames() == 0 {
        return Err(format!("{name}: no {what} reference in {}: no reflectance", folder.display()));
    }
    Ok(reference)
}

/// The images of a folder by name; none if there is no such folder.
fn frames(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let is_image = |path: &PathBuf| path.extension().is_some_and(|e| e == "pgm" || e == "tif" || e == "tiff");
    let mut paths: Vec<PathBuf> = paths.filter(is_image).collect();
    paths.sort();
    paths
}
