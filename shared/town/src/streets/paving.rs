//! Ground covers and their surfaces.

use crate::material::Material;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use messages::ClassId;

/// A cover of the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paving {
    /// Cover of roads.
    Asphalt,
    /// Lines and bars on the road.
    Paint,
    /// Stones along the road.
    Kerb,
    /// Cover of sidewalks.
    Slab,
    /// Cover of shoulders and yards.
    Gravel,
    /// Stones of squares and courtyards.
    Cobble,
    /// Cover of meadows and lawns.
    Grass,
}

/// The surfaces of all covers.
#[derive(Clone, Copy, Debug)]
pub struct Pavings {
    ids: [SurfaceId; 7],
}

impl Pavings {
    /// Registers the surfaces in the builder.
    pub fn new(b: &mut SceneBuilder) -> Self {
        let kinds = [
            (ClassId::Road, Material::Asphalt),
            (ClassId::RoadLine, Material::RoadPaint),
            (ClassId::Sidewalk, Material::Granite),
            (ClassId::Sidewalk, Material::Slab),
            (ClassId::Ground, Material::Gravel),
            (ClassId::Ground, Material::Cobble),
            (ClassId::Terrain, Material::Grass),
        ];
        Self { ids: kinds.map(|(class, material)| b.surface(class, 0, material)) }
    }
    /// The surface of a cover.
    pub const fn id(&self, paving: Paving) -> SurfaceId {
        self.ids[paving as usize]
    }
}
