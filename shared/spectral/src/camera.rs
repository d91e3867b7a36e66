//! A mosaic camera of a drive with everything that its frames need: the only place of this crate that reads files.

use crate::{Calibration, Correction, FrameCounts, Mosaic, Reference, SpectralError, WhiteTarget};
use formats::manifest::MosaicEntry;
use formats::pgm::Pgm;
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
    /// Reads the references of a camera of the drive in folder `drive`: all PGM files in the camera's `dark` and `white`. With
    /// a `sensor` its cubes are corrected by the sensor's matrix for reflectances. The error is one line for the operator.
    pub fn read(drive: &Path, entry: &MosaicEntry, sensor: Option<&SensorCalibration>) -> Result<Self, String> {
        let name = &entry.name;
        let named = |error: SpectralError| format!("{name}: {error}");
        let (width, height) = entry.model.size();
        let mosaic = Mosaic::new([width, height], entry.pattern, entry.active_area, entry.bit_depth).map_err(named)?;
        let n_bands = mosaic.n_bands();
        if entry.wavelengths_nm.len() != n_bands {
            let n = entry.wavelengths_nm.len();
            return Err(format!("{name}: {n} wavelengths for {n_bands} bands; must be one for each"));
        }
        let folder = drive.join(&entry.folder);
        let dark = read_reference(name, "dark", &folder, &mosaic)?;
        let white = read_reference(name, "white", &folder, &mosaic)?;
        let target = WhiteTarget { reflectance: entry.white_reflectance, exposure_nanos: entry.white_exposure_nanos };
        let calibration = Calibration::new(&mosaic, &dark, &white, target).map_err(named)?;
        let virtual_bands = sensor.and_then(SensorCalibration::reflectance_matrix).map(|matrix| &matrix.virtual_bands);
        let rows = |bands: &Vec<VirtualBand>| {
            Correction::new(n_bands, bands.iter().map(|band| &band.coefficients[..])).map_err(named)
        };
        let correction = virtual_bands.map(rows).transpose()?;
        let wavelengths_nm = match virtual_bands {
            Some(bands) => bands.iter().map(|band| band.wavelength_nm as f32).collect(),
            None => entry.wavelengths_nm.iter().map(|nm| *nm as f32).collect(),
        };
        let measured = calibration.valid_bands();
        let valid_bands = correction.as_ref().map_or(measured, |correction| correction.valid(measured));
        Ok(Self { calibration, correction, wavelengths_nm, valid_bands })
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

/// The mean of all frames in `<folder>/<what>`, in the order of their names.
fn read_reference(name: &str, what: &'static str, folder: &Path, mosaic: &Mosaic) -> Result<Reference, String> {
    let folder = folder.join(what);
    let mut reference = Reference::new(what, mosaic);
    let [width, height] = mosaic.size();
    for path in frames(&folder) {
        let about = |error: &dyn std::fmt::Display| format!("{name}: {}: {error}", path.display());
        let bytes = std::fs::read(&path).map_err(|error| about(&error))?;
        let frame = Pgm::parse(&bytes).map_err(|error| about(&error))?;
        if (frame.width, frame.height) != (width, height) {
            return Err(about(&format!("{}x{} px; must be {width}x{height}", frame.width, frame.height)));
        }
        reference.add(&frame.samples()).map_err(|error| about(&error))?;
    }
    if reference.n_frames() == 0 {
        return Err(format!("{name}: no {what} reference in {}: no reflectance", folder.display()));
    }
    Ok(reference)
}

/// The PGM files of a folder by name; none if there is no such folder.
fn frames(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut paths: Vec<PathBuf> = paths.filter(|path| path.extension().is_some_and(|e| e == "pgm")).collect();
    paths.sort();
    paths
}
