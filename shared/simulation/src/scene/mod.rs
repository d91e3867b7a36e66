//! What there is to see: a town that stands and things that move through it. Nothing here knows of sensors.
//!
//! | module | says |
//! |---|---|
//! | `terrain`, `profile`, `street`, `network` | the lie of the land and the street map |
//! | `grid`, `country` | street maps of towns |
//! | `lane`, `reach` | where vehicles drive, and what of the town is near enough to be built |
//! | `paving`, `ground`, `junction` | what covers the ground |
//! | `town` | the order in which a town is filled |
//! | `rows`, `gardens`, `open_blocks`, `rural`, `crossings`, `kerbside`, `parking` | what stands where |
//! | `models` | how it looks |
//! | `traffic`, `mover`, `clearance` | what moves |

mod builder;
pub mod catalogue;
mod clearance;
mod country;
mod crossings;
mod fleet;
mod gardens;
mod grid;
mod ground;
mod junction;
mod kerbside;
mod lane;
mod models;
mod mover;
mod network;
mod open_blocks;
mod parking;
mod paving;
mod profile;
mod reach;
mod rows;
mod rural;
mod street;
mod terrain;
mod town;
mod traffic;

pub use mover::{Mover, Route, Timing};
pub use profile::LANE_T;
pub use terrain::{MAX_SLOPE, Terrain};
pub use town::{Drive, build};

use crate::material::Material;
use crate::trace::{Bvh, Primitive, Ray, Vec3};
use messages::ClassId;
use nalgebra::{Isometry3, Point3};

/// What a primitive belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Meaning.
    pub class: ClassId,
    /// 0 = none; vehicles and pedestrians have one each.
    pub instance: u16,
    /// Looks.
    pub material: Material,
}

/// The whole town, in the world frame (east, north, up).
#[derive(Clone, Debug)]
pub struct Scene {
    statics: Bvh,
    movers: Vec<Mover>,
    surfaces: Vec<Surface>,
}

/// Where the moving things are at one time.
#[derive(Clone, Debug)]
pub struct Snapshot {
    placed: Vec<Placed>,
}

#[derive(Clone, Debug)]
struct Placed {
    center: Vec3,
    radius: f32,
    world_from_object: Isometry3<f32>,
}

/// What a ray found.
#[derive(Clone, Copy, Debug)]
pub struct SceneHit {
    /// Length of the ray, m.
    pub range_m: f32,
    /// Unit, against the ray.
    pub normal: Vec3,
    /// What was hit.
    pub surface: Surface,
    /// The point in the frame of the thing that was hit, m; textures hang on it.
    pub texture_point: Vec3,
}

impl Scene {
    /// Where everything is, `seconds` after the drive's begin.
    pub fn at(&self, seconds: f64) -> Snapshot {
        let placed = self
            .movers
            .iter()
            .map(|mover| {
                let world_from_object = mover.pose(seconds);
                let center = (world_from_object * Point3::from(mover.center)).coords;
                Placed { center, radius: mover.radius, world_from_object }
            })
            .collect();
        Snapshot { placed }
    }

    /// The nearest surface before `max_m`.
    pub fn cast(&self, snapshot: &Snapshot, ray: &Ray, max_m: f32) -> Option<SceneHit> {
        let mut limit = max_m;
        let mut best = None;
        if let Some((range, primitive)) = self.statics.nearest(ray, limit) {
            limit = range;
            best = Some(self.hit(ray, range, primitive));
        }
        for (mover, placed) in self.movers.iter().zip(&snapshot.placed) {
            if !placed.is_near(ray, limit) {
                continue;
            }
            let local = placed.local(ray);
            if let Some((range, primitive)) = mover.model.nearest(&local, limit) {
                limit = range;
                let hit = self.hit(&local, range, primitive);
                best = Some(SceneHit { normal: placed.world_from_object.rotation * hit.normal, ..hit });
            }
        }
        best
    }

    /// Whether anything lies before `max_m`.
    pub fn is_blocked(&self, snapshot: &Snapshot, ray: &Ray, max_m: f32) -> bool {
        self.statics.any(ray, max_m)
            || self
                .movers
                .iter()
                .zip(&snapshot.placed)
                .any(|(mover, placed)| placed.is_near(ray, max_m) && mover.model.any(&placed.local(ray), max_m))
    }

    /// Things that move.
    pub fn movers(&self) -> &[Mover] {
        &self.movers
    }

    /// Number of primitives, standing and moving.
    pub fn n_primitives(&self) -> usize {
        self.statics.len() + self.movers.iter().map(|mover| mover.model.len()).sum::<usize>()
    }

    fn hit(&self, ray: &Ray, range_m: f32, primitive: &Primitive) -> SceneHit {
        SceneHit {
            range_m,
            normal: primitive.shape.normal(ray, range_m),
            surface: self.surfaces[primitive.surface as usize],
            texture_point: ray.at(range_m),
        }
    }
}

impl Placed {
    /// Whether the ray meets the ball around the thing before `max_m`.
    fn is_near(&self, ray: &Ray, max_m: f32) -> bool {
        let to_center = self.center - ray.origin;
        let along = to_center.dot(&ray.direction);
        let off2 = (to_center - ray.direction * along).norm_squared();
        off2 < self.radius * self.radius && along > -self.radius && along < max_m + self.radius
    }
    fn local(&self, ray: &Ray) -> Ray {
        Ray {
            origin: self.world_from_object.inverse_transform_point(&Point3::from(ray.origin)).coords,
            direction: self.world_from_object.inverse_transform_vector(&ray.direction),
            seed: ray.seed,
        }
    }
}
