//! Rays through the pixels of a lens.

use geometry::{CameraModel, Vector2};
use raytrace::Vec3;

/// Maximum range of camera rays, m.
pub const FAR_M: f32 = 250.0;

/// Directions through image points, in the camera frame; `None` outside the field of view.
pub fn lens_rays(model: &CameraModel, pixels: impl Iterator<Item = [f64; 2]>) -> Vec<Option<Vec3>> {
    pixels.map(|[u, v]| model.ray_from_pixel(&Vector2::new(u, v)).map(nalgebra::Vector3::cast)).collect()
}
