//! What is in the clouds, for programs that do not want to open them all.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// `clouds/index.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Index {
    /// Of this layout.
    pub version: u32,
    /// Frame of the clouds' coordinates.
    pub frame: String,
    /// Points of all clouds.
    pub n_points: u64,
    /// In the order of the drive.
    pub clouds: Vec<CloudEntry>,
}

/// One submap's files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CloudEntry {
    /// Number of the submap.
    pub seq: u64,
    /// Relative to the output folder.
    pub file: String,
    /// Size of the file.
    pub bytes: u64,
    /// Rows of the file.
    pub n_points: u64,
    /// ns since the Unix epoch, first shot.
    pub stamp_begin: i64,
    /// ns since the Unix epoch, last shot.
    pub stamp_end: i64,
    /// Smallest and largest x y z, m. None without points.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Translation of `world_from_submap`, m; always local, also where coordinates are those of a map.
    pub translation: [f64; 3],
    /// Rotation of `world_from_submap`, unit quaternion x y z w.
    pub rotation: [f64; 4],
    /// Standard deviation of that position along the submap's axes, m. None if nobody placed it.
    pub sigma_m: Option<[f32; 3]>,
    /// Standard deviation of that rotation about the submap's axes, rad. None if nobody placed it.
    pub sigma_rad: Option<[f32; 3]>,
    /// Points with a color. None if there is no color column.
    pub n_colored: Option<u64>,
    /// Points by class. None if there is no class column.
    pub classes: Option<BTreeMap<String, u64>>,
    /// Different instances. None if there is no instance column.
    pub n_instances: Option<u64>,
    /// The cloud of spectra, if there is a spectra column.
    pub spectra: Option<SpectraEntry>,
    /// Live mode: columns that were published and never arrived.
    pub lost: Vec<String>,
}

/// The points that a mosaic camera saw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpectraEntry {
    /// Relative to the output folder.
    pub file: String,
    /// Size of the file.
    pub bytes: u64,
    /// Rows of the file.
    pub n_spectra: u64,
    /// Center of each band, nm, in the order of the columns.
    pub wavelengths_nm: Vec<f32>,
}

impl Index {
    pub(crate) fn new(clouds: &[CloudEntry], frame: &str) -> Self {
        Self {
            version: 2,
            frame: frame.to_owned(),
            n_points: clouds.iter().map(|cloud| cloud.n_points).sum(),
            clouds: clouds.to_vec(),
        }
    }

    pub(crate) fn to_json(&self) -> String {
        let text = serde_json::to_string_pretty(self).expect("string keys and plain values always encode");
        text + "\n"
    }
}

impl CloudEntry {
    /// Whether its files are where they belong.
    pub(crate) fn is_placed(&self) -> bool {
        self.sigma_m.is_some()
    }
    /// Names, sizes and rows of all files.
    pub(crate) fn files(&self) -> impl Iterator<Item = (&str, u64, u64)> {
        let spectra = self.spectra.iter().map(|spectra| (spectra.file.as_str(), spectra.bytes, spectra.n_spectra));
        std::iter::once((self.file.as_str(), self.bytes, self.n_points)).chain(spectra)
    }
}
