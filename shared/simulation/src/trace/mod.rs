//! Rays against surfaces: primitives and the tree over them. f32 throughout: within 1 km of the origin its steps are
//! below 0.1 mm, a twentieth of the lidar's quantization.

mod bvh;
mod primitive;

pub use bvh::Bvh;
pub use primitive::{Primitive, Shape};

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
}
