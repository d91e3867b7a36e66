//! Parses `drive.toml`.

use crate::manifest::{
    CameraEntry, GnssEntry, ImuEntry, LidarEntry, Manifest, MosaicEntry, TrajectoryEntry, TruthEntry,
};
use files::toml_file::TomlFile;
use std::path::Path;

/// The entries of a manifest that could be read, with the problems found so far. Entries that could not be read are among
/// the problems and do not prevent the checks of the others.
pub(super) struct Read {
    pub(super) file: TomlFile,
    pub(super) version: Option<u32>,
    pub(super) name: Option<String>,
    /// The entries of LiDARs, at least one.
    pub(super) lidars: Vec<Option<LidarEntry>>,
    pub(super) cameras: Vec<Option<CameraEntry>>,
    pub(super) mosaics: Vec<Option<MosaicEntry>>,
    pub(super) gnss: Option<GnssEntry>,
    pub(super) imu: Option<ImuEntry>,
    pub(super) trajectory: Option<TrajectoryEntry>,
    pub(super) truth: Option<TruthEntry>,
}

const KEYS: [&str; 9] = ["version", "name", "lidar", "camera", "mosaic", "gnss", "imu", "trajectory", "truth"];

// The required keys of an entry.
const LIDAR: [&str; 4] = ["model", "format", "folder", "body_from_lidar"];
const CAMERA: [&str; 5] = ["name", "folder", "exposure_nanos", "body_from_camera", "model"];
const MOSAIC: [&str; 12] = [
    "name",
    "folder",
    "exposure_nanos",
    "dark_exposure_nanos",
    "white_exposure_nanos",
    "white_reflectance",
    "bit_depth",
    "pattern",
    "active_area",
    "wavelengths_nm",
    "body_from_camera",
    "model",
];
const GNSS: [&str; 3] = ["file", "origin", "antenna_in_body"];
const IMU: [&str; 1] = ["file"];
const TRAJECTORY: [&str; 2] = ["file", "format"];
const TRUTH: [&str; 1] = ["trajectory"];

impl Read {
    /// A manifest that was inferred, not read.
    pub(super) fn inferred(path: &Path, manifest: Manifest) -> Self {
        let Manifest { version, name, lidar, other_lidars, cameras, mosaics, gnss, imu, trajectory, truth } = manifest;
        Self {
            file: TomlFile::new(path, "", &KEYS),
            version: Some(version),
            name: Some(name),
            lidars: [vec![lidar], other_lidars].concat().into_iter().map(Some).collect(),
            cameras: cameras.into_iter().map(Some).collect(),
            mosaics: mosaics.into_iter().map(Some).collect(),
            gnss,
            imu,
            trajectory,
            truth,
        }
    }

    pub(super) fn from_text(path: &Path, text: String) -> Self {
        let mut file = TomlFile::new(path, text, &KEYS);
        Self {
            version: file.required("version", &[]),
            name: file.required("name", &[]),
            lidars: file.one_or_more("lidar", &LIDAR),
            cameras: file.list("camera", &CAMERA),
            mosaics: file.list("mosaic", &MOSAIC),
            gnss: file.optional("gnss", &GNSS),
            imu: file.optional("imu", &IMU),
            trajectory: file.optional("trajectory", &TRAJECTORY),
            truth: file.optional("truth", &TRUTH),
            file,
        }
    }

    /// The manifest; `None` if an entry could not be read.
    pub(super) fn manifest(&self) -> Option<Manifest> {
        let mut lidars = self.lidars.iter().cloned();
        Some(Manifest {
            version: self.version?,
            name: self.name.clone()?,
            lidar: lidars.next()??,
            other_lidars: lidars.collect::<Option<_>>()?,
            cameras: self.cameras.iter().cloned().collect::<Option<_>>()?,
            mosaics: self.mosaics.iter().cloned().collect::<Option<_>>()?,
            gnss: self.gnss.clone(),
            imu: self.imu.clone(),
            trajectory: self.trajectory.clone(),
            truth: self.truth.clone(),
        })
    }
}
