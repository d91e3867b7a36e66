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
use crate::trace::{Bvh, Placed, Primitive, Ray, Swarm, Vec3};
use messages::ClassId;
use nalgebra::Point3;

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
pub struct Snapshot(Swarm);

impl Snapshot {
    /// Whether each ray may meet something that moves; known only of rays of one time, to be found out of others.
    fn may_meet<'s>(snapshot: impl Fn(usize) -> &'s Self, rays: &[Ray], limit: impl Fn(usize) -> f32) -> Vec<bool> {
        if (1..rays.len()).any(|i| !std::ptr::eq(snapshot(i), snapshot(0))) {
            return (0..rays.len()).map(|i| limit(i) >= 0.0).collect();
        }
        if rays.is_empty() { Vec::new() } else { snapshot(0).0.may_meet(rays, limit) }
    }
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
        Snapshot(Swarm::new(&(0..self.movers.len()).map(|number| self.placed(number, seconds)).collect::<Vec<_>>()))
    }

    /// Where some of the movers are, by their numbers; the others are nowhere.
    pub fn some_at(&self, movers: &[usize], seconds: f64) -> Snapshot {
        Snapshot(Swarm::new(&movers.iter().map(|number| self.placed(*number, seconds)).collect::<Vec<_>>()))
    }

    /// Numbers of the movers that come within `reach_m` of a point.
    pub fn movers_near(&self, point: &Vec3, reach_m: f32, seconds: f64) -> Vec<usize> {
        let is_near = |number: &usize| {
            let placed = self.placed(*number, seconds);
            (placed.center - point).norm() < reach_m + placed.radius
        };
        (0..self.movers.len()).filter(is_near).collect()
    }

    /// The nearest surface before `max_m`.
    pub fn cast(&self, snapshot: &Snapshot, ray: &Ray, max_m: f32) -> Option<SceneHit> {
        self.cast_on(snapshot, ray, max_m, self.statics.nearest(ray, max_m))
    }

    /// The same for many rays, ray i at the time of `snapshot(i)`; several times as fast for rays that go nearly the same way as
    /// those before and after them.
    pub fn cast_all<'s>(
        &self,
        rays: &[Ray],
        max_m: f32,
        snapshot: impl Fn(usize) -> &'s Snapshot,
    ) -> Vec<Option<SceneHit>> {
        let standing = self.statics.nearest_of(rays, max_m);
        let limit = |i: usize| standing[i].map_or(max_m, |(range, _)| range);
        let may_move = Snapshot::may_meet(&snapshot, rays, limit);
        let hit = |(i, ray): (usize, &Ray)| {
            if may_move[i] {
                return self.cast_on(snapshot(i), ray, max_m, standing[i]);
            }
            standing[i].map(|(range, primitive)| self.hit(ray, range, primitive))
        };
        rays.iter().enumerate().map(hit).collect()
    }

    /// The nearest of movers and what stands.
    fn cast_on(
        &self,
        snapshot: &Snapshot,
        ray: &Ray,
        max_m: f32,
        standing: Option<(f32, &Primitive)>,
    ) -> Option<SceneHit> {
        let limit = standing.map_or(max_m, |(range, _)| range);
        let mut best = standing.map(|(range, primitive)| self.hit(ray, range, primitive));
        snapshot.0.visit(ray, limit, |placed, local, limit| {
            if let Some((range, primitive)) = self.movers[placed.number].models[placed.phase].nearest(local, *limit) {
                *limit = range;
                let hit = self.hit(local, range, primitive);
                best = Some(SceneHit { normal: placed.world_from_object.rotation * hit.normal, ..hit });
            }
            false
        });
        best
    }

    /// Whether anything lies before `max_m`.
    pub fn is_blocked(&self, snapshot: &Snapshot, ray: &Ray, max_m: f32) -> bool {
        self.statics.any(ray, max_m) || self.is_hidden(snapshot, ray, max_m)
    }

    /// Whether something that moves lies before `max_m`.
    fn is_hidden(&self, snapshot: &Snapshot, ray: &Ray, max_m: f32) -> bool {
        let mut is_hidden = false;
        snapshot.0.visit(ray, max_m, |placed, local, limit| {
            is_hidden = self.movers[placed.number].models[placed.phase].any(local, *limit);
            is_hidden
        });
        is_hidden
    }

    /// [`Scene::is_blocked`] of many rays, in the same way as [`Scene::cast_all`].
    pub fn are_blocked<'s>(&self, rays: &[Ray], max_m: f32, snapshot: impl Fn(usize) -> &'s Snapshot) -> Vec<bool> {
        let mut blocked = self.statics.any_of(rays, max_m);
        let may_move = Snapshot::may_meet(&snapshot, rays, |i| if blocked[i] { -1.0 } else { max_m });
        for (i, ray) in rays.iter().enumerate() {
            blocked[i] |= may_move[i] && self.is_hidden(snapshot(i), ray, max_m);
        }
        blocked
    }

    /// What stands.
    pub fn statics(&self) -> &Bvh {
        &self.statics
    }

    /// The same town where everything has the class and instance that `label` gives: what no sensor may notice.
    #[must_use]
    pub fn relabeled(mut self, label: impl Fn(ClassId, u16) -> (ClassId, u16)) -> Self {
        for surface in &mut self.surfaces {
            (surface.class, surface.instance) = label(surface.class, surface.instance);
        }
        self
    }

    /// Things that move.
    pub fn movers(&self) -> &[Mover] {
        &self.movers
    }

    /// Number of primitives, standing and moving.
    pub fn n_primitives(&self) -> usize {
        self.statics.len() + self.movers.iter().flat_map(|mover| &mover.models).map(Bvh::len).sum::<usize>()
    }

    fn placed(&self, number: usize, seconds: f64) -> Placed {
        let mover = &self.movers[number];
        let world_from_object = mover.pose(seconds);
        let center = (world_from_object * Point3::from(mover.center)).coords;
        Placed { number, phase: mover.phase(seconds), world_from_object, center, radius: mover.radius }
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
