//! Extrinsics of all sensors.

use crate::{CameraModel, Pose};

/// Mounting of all sensors relative to the body frame (`T_body_lidar` and `T_body_camera` in the literature).
/// `camera_from_lidar` is derived, never stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Mounting of the first lidar.
    pub body_from_lidar: Pose,
    /// Mountings of the other lidars.
    pub body_from_other_lidars: Vec<Pose>,
    /// Color cameras.
    pub cameras: Vec<RigCamera>,
    /// Mosaic cameras. Their model describes the raw image.
    pub mosaics: Vec<RigCamera>,
}

/// Mounting and lens of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct RigCamera {
    /// Camera mounting.
    pub body_from_camera: Pose,
    /// Lens.
    pub model: CameraModel,
}
