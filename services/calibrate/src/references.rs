//! Dark and white frames of a drive.

use formats::manifest::MosaicEntry;
use formats::pgm::Pgm;
use messages::{CubeHeader, MAX_CUBE_BANDS, MosaicHeader};
use spectral::{Calibration, Mosaic, Reference, WhiteTarget};
use std::path::{Path, PathBuf};

/// A mosaic camera with its references.
pub struct Camera {
    calibration: Calibration,
    header: CubeHeader,
}

impl Camera {
    /// Reads the references of the drive's mosaic camera `index`. The error is one line for the operator.
    pub fn read(drive: &Path, index: usize, entry: &MosaicEntry) -> Result<Self, String> {
        let name = &entry.name;
        let (width, height) = entry.model.size();
        let mosaic = Mosaic::new([width, height], entry.pattern, entry.active_area, entry.bit_depth)
            .map_err(|error| format!("{name}: {error}"))?;
        let folder = drive.join(&entry.folder);
        let dark = read_reference(name, "dark", &folder, &mosaic)?;
        let white = read_reference(name, "white", &folder, &mosaic)?;
        let target = WhiteTarget { reflectance: entry.white_reflectance, exposure_nanos: entry.white_exposure_nanos };
        let calibration =
            Calibration::new(&mosaic, &dark, &white, target).map_err(|error| format!("{name}: {error}"))?;
        let header = cube_header(index, entry, &calibration)?;
        Ok(Self { calibration, header })
    }

    /// Ready for frames.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The header of this camera's cubes; the exposure time is the frame's.
    pub fn cube_header(&self, frame: &MosaicHeader) -> CubeHeader {
        CubeHeader { exposure_nanos: frame.exposure_nanos, ..self.header }
    }

    /// Whether the frame is one of this camera.
    pub fn fits(&self, frame: &MosaicHeader) -> bool {
        let mosaic = self.calibration.mosaic();
        mosaic.size() == [frame.width, frame.height] && mosaic.bit_depth() == frame.bit_depth
    }
}

fn cube_header(index: usize, entry: &MosaicEntry, calibration: &Calibration) -> Result<CubeHeader, String> {
    let mosaic = calibration.mosaic();
    let n_bands = mosaic.n_bands();
    if entry.wavelengths_nm.len() != n_bands {
        let n = entry.wavelengths_nm.len();
        return Err(format!("{}: {n} wavelengths for {n_bands} bands; must be one for each", entry.name));
    }
    let mut wavelengths_nm = [0.0; MAX_CUBE_BANDS];
    for (out, wavelength_nm) in wavelengths_nm.iter_mut().zip(&entry.wavelengths_nm) {
        *out = *wavelength_nm as f32;
    }
    let ([width, height], [x0, y0]) = (mosaic.cells(), mosaic.origin());
    Ok(CubeHeader {
        camera: index as u32,
        width,
        height,
        n_bands: n_bands as u32,
        pattern: mosaic.pattern(),
        valid_bands: calibration.valid_bands(),
        x0,
        y0,
        exposure_nanos: 0,
        wavelengths_nm,
    })
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
