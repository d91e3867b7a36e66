//! The index of clouds: metadata for programs that do not open every cloud.

use geometry::{Pose, Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// `clouds/index.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Index {
    /// Version of this file format.
    pub version: u32,
    /// Frame of the coordinates of the clouds.
    pub frame: String,
    /// Number of points of all clouds.
    pub n_points: u64,
    /// Clouds in the order of the drive.
    pub clouds: Vec<CloudEntry>,
}

/// The files of one submap.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CloudEntry {
    /// Number of the submap.
    pub seq: u64,
    /// Path relative to the output folder.
    pub file: String,
    /// Size of the file, bytes.
    pub bytes: u64,
    /// Number of points.
    pub n_points: u64,
    /// Time of the first shot, ns since the Unix epoch.
    pub stamp_begin: i64,
    /// Time of the last shot, ns since the Unix epoch.
    pub stamp_end: i64,
    /// Smallest and largest x y z, m. None without points.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Translation of `world_from_submap`, m, in the local frame, even if coordinates are UTM. Without placement it is
    /// the translation of `odom_from_submap`.
    pub translation: [f64; 3],
    /// Rotation of the same pose, unit quaternion x y z w.
    pub rotation: [f64; 4],
    /// Standard deviation of the position along the axes of the submap, m. None without placement.
    pub sigma_m: Option<[f32; 3]>,
    /// Standard deviation of the rotation about the axes of the submap, rad. None without placement.
    pub sigma_rad: Option<[f32; 3]>,
    /// Number of points with a color. None without color column.
    pub n_colored: Option<u64>,
    /// Number of points by class. None without class column.
    pub classes: Option<BTreeMap<String, u64>>,
    /// Number of instances. None without instance column.
    pub n_instances: Option<u64>,
    /// The cloud of spectra. None without spectra column.
    pub spectra: Option<SpectraEntry>,
    /// Live mode: columns that were lost.
    pub lost: Vec<String>,
}

/// The cloud of points that a mosaic camera recorded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpectraEntry {
    /// Path relative to the output folder.
    pub file: String,
    /// Size of the file, bytes.
    pub bytes: u64,
    /// Number of spectra.
    pub n_spectra: u64,
    /// Center of each band in the order of the columns, nm.
    pub wavelengths_nm: Vec<f32>,
}

impl Index {
    /// The index of all clouds.
    pub fn new(clouds: &[CloudEntry], frame: &str) -> Self {
        Self {
            version: 2,
            frame: frame.to_owned(),
            n_points: clouds.iter().map(|cloud| cloud.n_points).sum(),
            clouds: clouds.to_vec(),
        }
    }

    /// The text of the file.
    pub fn to_json(&self) -> String {
        let text = serde_json::to_string_pretty(self).expect("string keys and plain values always encode");
        text + "\n"
    }
}

impl CloudEntry {
    /// Whether its files are in the final frame.
    pub fn is_placed(&self) -> bool {
        self.sigma_m.is_some()
    }
    /// The pose with `translation` and `rotation`.
    pub fn pose(&self) -> Pose {
        let [x, y, z, w] = self.rotation;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        Pose::from_parts(Vector3::from(self.translation).into(), rotation)
    }
    /// Names, sizes and numbers of rows of all files.
    pub(crate) fn files(&self) -> impl Iterator<Item = (&str, u64, u64)> {
        let spectra = self.spectra.iter().map(|spectra| (spectra.file.as_str(), spectra.bytes, spectra.n_spectra));
        std::iter::once((self.file.as_str(), self.bytes, self.n_points)).chain(spectra)
    }
}
