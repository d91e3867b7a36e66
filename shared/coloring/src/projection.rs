//! Projection of a chunk of points into an image.

use crate::chunk::{CHUNK, Chunk, Lanes};
use crate::lens::{FisheyeLens, Lens, PinholeLens, SplineWarpLens};
use pulp::{Arch, NullaryFnOnce};

/// Pixels of the points of a chunk.
#[derive(Debug)]
pub struct Projected {
    /// px; NaN for points that the lens cannot see.
    pub u: Lanes<f32>,
    /// px; NaN for points that the lens cannot see.
    pub v: Lanes<f32>,
    /// Distance from the camera, m.
    pub range_m: Lanes<f32>,
}

impl Default for Projected {
    fn default() -> Self {
        Self { u: [f32::NAN; CHUNK], v: [f32::NAN; CHUNK], range_m: [f32::NAN; CHUNK] }
    }
}

impl Projected {
    /// Projects all points of the chunk.
    pub fn fill(&mut self, chunk: &Chunk, camera_from_submap: &[[f32; 4]; 3], lens: &Lens) {
        let rows = *camera_from_submap;
        match lens {
            Lens::Pinhole(lens) => Arch::new().dispatch(Project { chunk, rows, lens: lens.clone(), out: self }),
            Lens::Fisheye(lens) => Arch::new().dispatch(Project { chunk, rows, lens: lens.clone(), out: self }),
            Lens::SplineWarp(lens) => Arch::new().dispatch(Project { chunk, rows, lens: lens.clone(), out: self }),
        }
    }
}

struct Project<'a, L> {
    chunk: &'a Chunk,
    rows: [[f32; 4]; 3],
    lens: L,
    out: &'a mut Projected,
}

/// The common interface of the lenses, so that one generic loop is compiled for each.
trait Projection {
    fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2];
}

impl Projection for PinholeLens {
    #[inline(always)]
    fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2] {
        self.pixel(p_in_camera)
    }
}

impl Projection for FisheyeLens {
    #[inline(always)]
    fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2] {
        self.pixel(p_in_camera)
    }
}

impl Projection for SplineWarpLens {
    #[inline(always)]
    fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2] {
        self.pixel(p_in_camera)
    }
}

impl<L: Projection> NullaryFnOnce for Project<'_, L> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { chunk, rows: [[a0, a1, a2, a3], [b0, b1, b2, b3], [c0, c1, c2, c3]], lens, out } = self;
        for i in 0..chunk.n_lanes() {
            let px = chunk.x[i];
            let py = chunk.y[i];
            let pz = chunk.z[i];
            let cx = a0 * px + a1 * py + a2 * pz + a3;
            let cy = b0 * px + b1 * py + b2 * pz + b3;
            let cz = c0 * px + c1 * py + c2 * pz + c3;
            let at = lens.pixel([cx, cy, cz]);
            out.u[i] = at[0];
            out.v[i] = at[1];
            out.range_m[i] = (cx * cx + cy * cy + cz * cz).sqrt();
        }
    }
}
