//! Extrinsics of all sensors.

use crate::{CameraModel, Pose};

/// Mounting of all sensors relative to the body frame (`T_body_lidar` and `T_body_camera` in the literature).
/// `camera_from_lidar` is derived, never stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Lidar mounting.
    pub body_from_lidar: Pose,
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
