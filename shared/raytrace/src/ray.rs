//! Rays, and the vector type of the tracer.

/// Hits closer than this belong to the surface that the ray starts on, m.
pub(crate) const MIN_RANGE_M: f32 = 1e-3;

/// A vector or point, m.
pub type Vec3 = nalgebra::Vector3<f32>;

/// A ray.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin, m.
    pub origin: Vec3,
    /// Direction, of unit length.
    pub direction: Vec3,
    /// Seed of the random depth at which the ray ends in a porous shape.
    pub seed: u64,
}

impl Ray {
    /// The point at `range_m`.
    #[inline]
    pub fn at(&self, range_m: f32) -> Vec3 {
        self.origin + self.direction * range_m
    }

    /// The direction with zeros replaced by 1e-18, so that its inverse is finite.
    #[inline]
    pub(crate) fn along(&self) -> Vec3 {
        self.direction.map(|d| if d.abs() < 1e-18 { 1e-18_f32.copysign(d) } else { d })
    }
}
