//! What the rig's sensors make of the scene. Each sees the scene through rays or the motion through its pose, adds its own
//! noise, and knows nothing of the others.

pub mod camera;
pub mod exposure;
pub mod gnss;
pub mod imu;
pub mod lidar;
pub mod look;
pub mod mosaic;
mod sky_view;
pub mod trigger;

use crate::trace::Vec3;
use geometry::{CameraModel, Vector2};

/// Nothing farther is seen, m.
pub(crate) const FAR_M: f32 = 250.0;

/// Directions through points of an image, in the camera's frame; `None` where the lens shows nothing.
pub(crate) fn lens_rays(model: &CameraModel, pixels: impl Iterator<Item = [f64; 2]>) -> Vec<Option<Vec3>> {
    pixels.map(|[u, v]| model.ray_from_pixel(&Vector2::new(u, v)).map(nalgebra::Vector3::cast)).collect()
}
