//! Primitives: triangles, panels, cuboids, cylinders, cones, spheres, and porous spheres for foliage.

use crate::ray::Vec3;
use nalgebra::{Isometry3, UnitQuaternion};

/// A shape with the index of its surface.
#[derive(Clone, Copy, Debug)]
pub struct Primitive {
    /// Geometry.
    pub shape: Shape,
    /// Index into the scene's surfaces.
    pub surface: u32,
}

/// The geometry of a primitive, m.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// A triangle, visible from both sides.
    Triangle {
        /// One corner.
        corner: Vec3,
        /// Edge to the second corner.
        edge1: Vec3,
        /// Edge to the third corner.
        edge2: Vec3,
    },
    /// A parallelogram, visible from both sides. Wire mesh is a panel that stops only some rays.
    Panel {
        /// One corner.
        corner: Vec3,
        /// Edge to the second corner.
        edge1: Vec3,
        /// Edge to the fourth corner.
        edge2: Vec3,
        /// Share of rays that the panel stops, above 0; 1 = solid.
        fill: f32,
    },
    /// An oriented box.
    Cuboid {
        /// Center of the box.
        center: Vec3,
        /// Half side lengths, above 0, in its own frame.
        half: Vec3,
        /// Rotation from its own frame.
        rotation: UnitQuaternion<f32>,
    },
    /// A cone frustum with flat ends.
    Cone {
        /// Center of one end.
        base: Vec3,
        /// Unit vector to the other end.
        axis: Vec3,
        /// Distance between the ends.
        length: f32,
        /// Radii at `base` and at the other end; one of them may be 0.
        radii: [f32; 2],
    },
    /// A cylinder with flat ends.
    Cylinder {
        /// Center of one end.
        base: Vec3,
        /// Unit vector to the other end.
        axis: Vec3,
        /// Distance between the ends.
        length: f32,
        /// Radius.
        radius: f32,
    },
    /// A sphere.
    Sphere {
        /// Center of the sphere.
        center: Vec3,
        /// Radius of the sphere.
        radius: f32,
    },
    /// A sphere of foliage: a ray ends in it at an exponentially distributed depth, or passes through.
    Porous {
        /// Center of the sphere.
        center: Vec3,
        /// Radius of the sphere.
        radius: f32,
        /// Mean depth at which rays end.
        free_path: f32,
    },
}

impl Shape {
    /// The triangle of three corners.
    pub fn triangle(a: Vec3, b: Vec3, c: Vec3) -> Self {
        Self::Triangle { corner: a, edge1: b - a, edge2: c - a }
    }
    /// The cylinder between two distinct points.
    pub fn cylinder(from: Vec3, to: Vec3, radius: f32) -> Self {
        let along = to - from;
        let length = along.norm().max(1e-6);
        Self::Cylinder { base: from, axis: along / length, length, radius }
    }
    /// The cone frustum between two distinct points.
    pub fn cone(from: Vec3, to: Vec3, radii: [f32; 2]) -> Self {
        let along = to - from;
        let length = along.norm().max(1e-6);
        Self::Cone { base: from, axis: along / length, length, radii }
    }
    /// The shape after a rigid transform.
    #[must_use]
    pub fn moved(&self, by: &Isometry3<f32>) -> Self {
        let point = |p: Vec3| (by * nalgebra::Point3::from(p)).coords;
        match *self {
            Self::Triangle { corner, edge1, edge2 } => {
                Self::Triangle { corner: point(corner), edge1: by.rotation * edge1, edge2: by.rotation * edge2 }
            }
            Self::Panel { corner, edge1, edge2, fill } => {
                Self::Panel { corner: point(corner), edge1: by.rotation * edge1, edge2: by.rotation * edge2, fill }
            }
            Self::Cuboid { center, half, rotation } => {
                Self::Cuboid { center: point(center), half, rotation: by.rotation * rotation }
            }
            Self::Cone { base, axis, length, radii } => {
                Self::Cone { base: point(base), axis: by.rotation * axis, length, radii }
            }
            Self::Cylinder { base, axis, length, radius } => {
                Self::Cylinder { base: point(base), axis: by.rotation * axis, length, radius }
            }
            Self::Sphere { center, radius } => Self::Sphere { center: point(center), radius },
            Self::Porous { center, radius, free_path } => Self::Porous { center: point(center), radius, free_path },
        }
    }
    /// Smallest and largest coordinates.
    pub fn bounds(&self) -> [Vec3; 2] {
        match *self {
            Self::Triangle { corner, edge1, edge2 } => {
                let b = corner + edge1;
                let c = corner + edge2;
                [corner.inf(&b).inf(&c), corner.sup(&b).sup(&c)]
            }
            Self::Panel { corner, edge1, edge2, .. } => {
                let b = corner + edge1;
                let c = corner + edge2;
                let d = b + edge2;
                [corner.inf(&b).inf(&c.inf(&d)), corner.sup(&b).sup(&c.sup(&d))]
            }
            Self::Cuboid { center, half, rotation } => {
                let reach = rotation.to_rotation_matrix().matrix().abs() * half;
                [center - reach, center + reach]
            }
            Self::Cone { base, axis, length, radii } => {
                let tip = base + axis * length;
                let [reach_base, reach_tip] = radii.map(|radius| disc_reach(&axis, radius));
                [(base - reach_base).inf(&(tip - reach_tip)), (base + reach_base).sup(&(tip + reach_tip))]
            }
            Self::Cylinder { base, axis, length, radius } => {
                let tip = base + axis * length;
                let reach = disc_reach(&axis, radius);
                [base.inf(&tip) - reach, base.sup(&tip) + reach]
            }
            Self::Sphere { center, radius } | Self::Porous { center, radius, .. } => {
                [center.add_scalar(-radius), center.add_scalar(radius)]
            }
        }
    }
}

/// Extent of a disc along each coordinate axis: radius * sin(angle between the axes).
fn disc_reach(axis: &Vec3, radius: f32) -> Vec3 {
    axis.map(|a| radius * (1.0 - a * a).max(0.0).sqrt())
}
