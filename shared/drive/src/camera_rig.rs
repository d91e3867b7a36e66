//! The cameras of a vehicle without their images: mounting, lenses, bands and calibrations.

use super::{Drive, LiveRig, check};
use crate::manifest::{CameraEntry, Manifest, MosaicEntry};
use files::problems::{FileError, FileProblem};
use files::toml_file::TomlFile;
use formats::sensor_calibration::SensorCalibration;
use geometry::{Isometry3, Rig};
use std::path::{Path, PathBuf};

/// The cameras of a recorded drive or of a live vehicle.
#[derive(Clone, Debug)]
pub struct CameraRig {
    folder: PathBuf,
    manifest: Option<Manifest>,
    rig: Rig,
    sensors: Vec<Option<SensorCalibration>>,
}

impl CameraRig {
    /// The cameras of a recorded drive.
    pub fn from_drive(folder: &Path) -> Result<Self, FileError> {
        Drive::open(folder).map(Self::from)
    }

    /// The cameras of a live vehicle. `path` is its manifest or the folder with it, as in [`LiveRig::find`]; without a manifest the vehicle
    /// has no cameras. Images and folders of images need not exist.
    pub fn from_live(path: &Path) -> Result<Self, FileError> {
        let (file, manifest) = match LiveRig::find(path)? {
            LiveRig::File(file, manifest) => (file, *manifest),
            LiveRig::Simulated(_) | LiveRig::Default => return Ok(Self::none()),
        };
        let folder = file.parent().unwrap_or(Path::new("")).to_owned();
        let sensors = check::cameras(&folder, TomlFile::new(&file, "", &[]), &manifest)?;
        let rig = manifest.rig().map_err(|error| FileProblem::for_file(&file, error.to_string()))?;
        Ok(Self { folder, manifest: Some(manifest), rig, sensors })
    }

    fn none() -> Self {
        let rig = Rig {
            body_from_lidar: Isometry3::identity(),
            body_from_other_lidars: Vec::new(),
            cameras: Vec::new(),
            mosaics: Vec::new(),
        };
        Self { folder: PathBuf::new(), manifest: None, rig, sensors: Vec::new() }
    }

    /// Folder of the manifest, to which the folders of the cameras are relative.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
    /// Mounting of the sensors.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }
    /// Entries of the color cameras.
    pub fn cameras(&self) -> &[CameraEntry] {
        self.manifest.as_ref().map_or(&[], |manifest| &manifest.cameras)
    }
    /// Entries of the mosaic cameras.
    pub fn mosaics(&self) -> &[MosaicEntry] {
        self.manifest.as_ref().map_or(&[], |manifest| &manifest.mosaics)
    }
    /// Manufacturer's calibration of each mosaic camera, if the manifest names one.
    pub fn sensors(&self) -> &[Option<SensorCalibration>] {
        &self.sensors
    }
    /// Band centers of the cubes of each mosaic camera, nm, as in [`Drive::expected_bands`].
    pub fn expected_bands(&self) -> Vec<Vec<f32>> {
        expected_bands(self.mosaics(), &self.sensors)
    }
}

impl From<Drive> for CameraRig {
    fn from(drive: Drive) -> Self {
        let Drive { folder, manifest, rig, sensors, .. } = drive;
        Self { folder, manifest: Some(manifest), rig, sensors }
    }
}

/// Band centers of the cubes of each mosaic camera, nm.
pub(super) fn expected_bands(mosaics: &[MosaicEntry], sensors: &[Option<SensorCalibration>]) -> Vec<Vec<f32>> {
    let bands = |(entry, sensor): (&MosaicEntry, &Option<SensorCalibration>)| match sensor
        .as_ref()
        .and_then(SensorCalibration::reflectance_matrix)
    {
        Some(matrix) => matrix.virtual_bands.iter().map(|band| band.wavelength_nm as f32).collect(),
        None => entry.wavelengths_nm.iter().map(|nm| *nm as f32).collect(),
    };
    mosaics.iter().zip(sensors).map(bands).collect()
}
