//! Rays against surfaces: primitives, the tree over them, and trees of trees for what moves. f32 throughout: within 1 km of the origin its steps are
//! below 0.1 mm, a twentieth of the lidar's quantization.

mod build;
mod bundle;
mod bvh;
mod pack;
mod primitive;
mod swarm;
mod together;
mod tree;

pub use bundle::RAYS;
pub use bvh::Bvh;
pub use primitive::{Primitive, Shape};
pub use swarm::{Placed, Swarm};

/// Closer hits are the surface that the ray starts on, m.
pub(crate) const MIN_RANGE_M: f32 = 1e-3;

/// A vector or point of the tracer, m.
pub type Vec3 = nalgebra::Vector3<f32>;

/// A half line.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts, m.
    pub origin: Vec3,
    /// Unit length.
    pub direction: Vec3,
    /// Decides where inside a porous body the ray ends.
    pub seed: u64,
}

impl Ray {
    /// The point at `range_m`.
    pub fn at(&self, range_m: f32) -> Vec3 {
        self.origin + self.direction * range_m
    }

    /// The direction, not quite parallel to any face of a box: no infinities in the inverse, so no infinity times zero.
    fn along(&self) -> Vec3 {
        self.direction.map(|d| if d.abs() < 1e-18 { 1e-18_f32.copysign(d) } else { d })
    }
}
