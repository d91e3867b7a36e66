//! An exposure of a camera, with the camera's pose at that time.

use crate::frustum::Frustum;
use crate::lens::Lens;

/// An exposure whose pose is known.
#[derive(Clone, Copy, Debug)]
pub struct PosedExposure<'a> {
    /// Middle of the exposure, ns since the Unix epoch.
    pub stamp: i64,
    /// Rows of the 3x4 matrix.
    pub camera_from_submap: [[f32; 4]; 3],
    /// Position of the camera, m, submap frame.
    pub position: [f32; 3],
    /// Lens of the camera.
    pub lens: &'a Lens,
    /// Field of view of the camera.
    pub frustum: Frustum,
    /// Usable part of the image: `min <= pixel < max` for u and v, px.
    pub min: [f32; 2],
    /// Upper end, exclusive; see `min`.
    pub max: [f32; 2],
}

impl PosedExposure<'_> {
    /// Whether the pixel is in the usable part.
    #[inline(always)]
    pub fn contains(&self, u: f32, v: f32) -> bool {
        // Bitwise instead of short-circuit, so that loops over this have no jumps. NaN is in no image.
        (u >= self.min[0]) & (v >= self.min[1]) & (u < self.max[0]) & (v < self.max[1])
    }

    /// A point of the submap in the camera frame, m.
    #[inline]
    pub fn in_camera(&self, p_in_submap: [f32; 3]) -> [f32; 3] {
        let p = p_in_submap;
        self.camera_from_submap.map(|[a, b, c, d]| a * p[0] + b * p[1] + c * p[2] + d)
    }
}
