//! Collects primitives and their surfaces.

use crate::material::Material;
use crate::surface::Surface;
use messages::ClassId;
use nalgebra::{Isometry3, Point3};
use raytrace::{Primitive, Shape, Vec3};

/// Index of a surface in the scene.
pub type SurfaceId = u32;

/// Quads whose corners deviate by less than this from a parallelogram are stored as one panel, m.
const FLAT_M: f32 = 2e-4;

/// The primitives and surfaces so far.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    pub primitives: Vec<Primitive>,
    pub surfaces: Vec<Surface>,
}

impl SceneBuilder {
    /// Index of a surface; a new surface is appended.
    pub fn surface(&mut self, class: ClassId, instance: u16, material: Material) -> SurfaceId {
        let surface = Surface { class, instance, material };
        // The latest surfaces are requested most often, and there are at most a few hundred.
        let known = self.surfaces.iter().rposition(|s| *s == surface);
        known.unwrap_or_else(|| {
            self.surfaces.push(surface);
            self.surfaces.len() - 1
        }) as SurfaceId
    }
    pub fn add(&mut self, shape: Shape, surface: SurfaceId) {
        self.primitives.push(Primitive { shape, surface });
    }
    /// Adds a quad with its corners in order around it. It is one panel if the corners form a parallelogram, otherwise
    /// two triangles. A quad without area is skipped, for example where a wall ends at the edge of a window.
    pub fn quad(&mut self, [a, b, c, d]: [Vec3; 4], surface: SurfaceId) {
        let edge1 = b - a;
        let edge2 = d - a;
        if (c - b - edge2).amax() < FLAT_M {
            if edge1.cross(&edge2).norm_squared() == 0.0 {
                return;
            }
            self.add(Shape::Panel { corner: a, edge1, edge2, fill: 1.0 }, surface);
        } else {
            self.triangle([a, b, c], surface);
            self.triangle([a, c, d], surface);
        }
    }
    /// Adds a triangle; skipped if the corners are on a line.
    pub fn triangle(&mut self, [a, b, c]: [Vec3; 3], surface: SurfaceId) {
        if (b - a).cross(&(c - a)).norm_squared() > 0.0 {
            self.add(Shape::triangle(a, b, c), surface);
        }
    }
    /// A box from its lowest to its highest corner in the frame `pose`.
    pub fn cuboid(&mut self, pose: &Isometry3<f32>, low: [f32; 3], high: [f32; 3], surface: SurfaceId) {
        let low = Vec3::from(low);
        let high = Vec3::from(high);
        let center = (pose * Point3::from((low + high) * 0.5)).coords;
        self.add(Shape::Cuboid { center, half: (high - low) * 0.5, rotation: pose.rotation }, surface);
    }
    /// Adds a copy of a model's primitives at a pose. Its surfaces belong to this builder.
    pub fn place(&mut self, model: &[Primitive], pose: &Isometry3<f32>) {
        self.primitives.extend(model.iter().map(|p| Primitive { shape: p.shape.moved(pose), surface: p.surface }));
    }
    /// Removes and returns the primitives from index `first` on.
    pub fn take_since(&mut self, first: usize) -> Vec<Primitive> {
        self.primitives.split_off(first)
    }
}
