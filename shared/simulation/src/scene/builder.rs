//! Collects primitives and their surfaces.

use super::Surface;
use crate::material::Material;
use crate::trace::{Primitive, Shape, Vec3};
use messages::ClassId;
use nalgebra::Isometry3;

/// Number of a surface in the scene's table.
pub type SurfaceId = u32;

/// What has been built so far.
#[derive(Clone, Debug, Default)]
pub struct Builder {
    pub primitives: Vec<Primitive>,
    pub surfaces: Vec<Surface>,
}

impl Builder {
    /// The number of a surface, new or known.
    pub fn surface(&mut self, class: ClassId, instance: u16, material: Material) -> SurfaceId {
        let surface = Surface { class, instance, material };
        // The newest are asked for most often, and there are a few hundred at most.
        let known = self.surfaces.iter().rposition(|s| *s == surface);
        known.unwrap_or_else(|| {
            self.surfaces.push(surface);
            self.surfaces.len() - 1
        }) as SurfaceId
    }
    pub fn add(&mut self, shape: Shape, surface: SurfaceId) {
        self.primitives.push(Primitive { shape, surface });
    }
    /// Two triangles; the corners go around.
    pub fn quad(&mut self, [a, b, c, d]: [Vec3; 4], surface: SurfaceId) {
        // Quads of zero width (a wall that ends where a window begins) have no area to hit.
        self.add(Shape::triangle(a, b, c), surface);
        self.add(Shape::triangle(a, c, d), surface);
    }
    /// A box from its lowest to its highest corner in the frame `pose`.
    pub fn cuboid(&mut self, pose: &Isometry3<f32>, low: [f32; 3], high: [f32; 3], surface: SurfaceId) {
        let corner = |i: usize| {
            let pick = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
            (pose * nalgebra::Point3::new(pick(0), pick(1), pick(2))).coords
        };
        for face in [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]] {
            self.quad(face.map(corner), surface);
        }
    }
    /// A copy of a model's primitives at a pose. Its surfaces are this builder's.
    pub fn place(&mut self, model: &[Primitive], pose: &Isometry3<f32>) {
        self.primitives.extend(model.iter().map(|p| Primitive { shape: p.shape.moved(pose), surface: p.surface }));
    }
    /// Takes the primitives that were built since there were `first`.
    pub fn take_since(&mut self, first: usize) -> Vec<Primitive> {
        self.primitives.split_off(first)
    }
}
