//! `truth/calibration.toml`: true mounting of the sensors of a simulated vehicle.

use super::PoseEntry;
use serde::{Deserialize, Serialize};

/// Mountings by sensor, in the order of `drive.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Position of the antenna in the body frame, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub antenna_in_body: Option<[f64; 3]>,
    /// Mounting of the first LiDAR.
    pub body_from_lidar: PoseEntry,
    /// The other LiDARs.
    #[serde(default, rename = "other_lidar", skip_serializing_if = "Vec::is_empty")]
    pub other_lidars: Vec<LidarMountingEntry>,
    /// Color cameras.
    #[serde(default, rename = "camera")]
    pub cameras: Vec<MountingEntry>,
    /// Mosaic cameras.
    #[serde(default, rename = "mosaic")]
    pub mosaics: Vec<MountingEntry>,
}

/// Mounting of a camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MountingEntry {
    /// Name in `drive.toml`.
    pub name: String,
    /// Mounting.
    pub body_from_camera: PoseEntry,
}

/// Mounting of a LiDAR after the first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LidarMountingEntry {
    /// Name in `drive.toml`.
    pub name: String,
    /// Mounting.
    pub body_from_lidar: PoseEntry,
}
