//! Each model on its own empty square, for pictures of the models.

use crate::material::Material;
use crate::models::catalogue::{ENTRIES, Entry};
use crate::scene::Scene;
use crate::scene_builder::SceneBuilder;
use crate::surface::Surface;
use messages::ClassId;
use random::Random;
use raytrace::{Bvh, Shape, Vec3};

/// A model on an empty square, at the origin.
#[derive(Clone, Debug)]
pub struct Exhibit {
    /// Module and function.
    pub name: &'static str,
    /// The model and the square.
    pub scene: Scene,
    /// Lowest and highest coordinates of the model, m.
    pub bounds: [Vec3; 2],
    /// Number of primitives of the model.
    pub n_primitives: usize,
    /// The classes of its parts.
    pub classes: &'static [ClassId],
    /// Largest size of any variant along x, y, z, m.
    pub largest: [f32; 3],
    /// Least height of the top of any variant, m.
    pub least_height: f32,
}

/// All models, varied by the seed.
pub fn exhibits(seed: u64) -> impl Iterator<Item = Exhibit> {
    ENTRIES.iter().map(move |entry| exhibit(entry, seed))
}

fn exhibit(entry: &Entry, seed: u64) -> Exhibit {
    let mut builder = SceneBuilder::default();
    (entry.build)(&mut builder, &mut Random::for_hashed_stream(seed, 1));
    let n_primitives = builder.primitives.len();
    let none = [Vec3::repeat(f32::INFINITY), Vec3::repeat(f32::NEG_INFINITY)];
    let bounds = builder.primitives.iter().fold(none, |[low, high], p| {
        let [a, b] = p.shape.bounds();
        [low.inf(&a), high.sup(&b)]
    });
    // Models below ground level, such as a canal, would be hidden under the square.
    let level = if bounds[0].z < -1.2 { bounds[0].z } else { 0.0 };
    let ground = builder.surface(ClassId::Ground, 0, Material::BeigeCloth);
    let corner = Vec3::new(-200.0, -200.0, level);
    builder.add(Shape::Panel { corner, edge1: Vec3::x() * 400.0, edge2: Vec3::y() * 400.0, fill: 1.0 }, ground);
    let SceneBuilder { primitives, surfaces } = builder;
    Exhibit {
        name: entry.name,
        scene: still(Bvh::new(primitives), surfaces),
        bounds,
        n_primitives,
        classes: entry.classes,
        largest: entry.largest,
        least_height: entry.least_height,
    }
}

/// A scene without movers.
fn still(statics: Bvh, surfaces: Vec<Surface>) -> Scene {
    Scene::new(statics, Vec::new(), surfaces)
}
