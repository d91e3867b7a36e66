//! A town for ray casts: static primitives, moving objects, and the surface of each.

use crate::movers::mover::Mover;
use crate::surface::Surface;
use messages::ClassId;
use nalgebra::Point3;
use raytrace::{Bvh, ObjectTree, PlacedObject, Primitive, Ray, Vec3};

/// The whole town, in the world frame (east, north, up).
#[derive(Clone, Debug)]
pub struct Scene {
    statics: Bvh,
    movers: Vec<Mover>,
    surfaces: Vec<Surface>,
}

/// Poses of the moving objects at one time.
#[derive(Clone, Debug)]
pub struct Snapshot(ObjectTree);

impl Snapshot {
    /// Whether each ray may hit a moving object. Rays at different times are not tested: the result is true unless their
    /// limit is negative.
    fn may_meet<'s>(snapshot: impl Fn(usize) -> &'s Self, rays: &[Ray], limit: impl Fn(usize) -> f32) -> Vec<bool> {
        if (1..rays.len()).any(|i| !std::ptr::eq(snapshot(i), snapshot(0))) {
            return (0..rays.len()).map(|i| limit(i) >= 0.0).collect();
        }
        if rays.is_empty() { Vec::new() } else { snapshot(0).0.may_meet(rays, limit) }
    }
}

/// The nearest hit of a ray.
#[derive(Clone, Copy, Debug)]
pub struct SceneHit {
    /// Length of the ray, m.
    pub range_m: f32,
    /// Unit normal, opposite to the ray.
    pub normal: Vec3,
    /// Surface that was hit.
    pub surface: Surface,
    /// The point in the frame of the hit object, m: texture coordinates.
    pub texture_point: Vec3,
}

impl Scene {
    /// A scene of static primitives and movers. Primitives refer to `surfaces` by index.
    pub(crate) const fn new(statics: Bvh, movers: Vec<Mover>, surfaces: Vec<Surface>) -> Self {
        Self { statics, movers, surfaces }
    }

    /// Poses of all movers, `seconds` after the start of the drive.
    pub fn at(&self, seconds: f64) -> Snapshot {
        Snapshot(ObjectTree::new(
            &(0..self.movers.len()).map(|number| self.placed(number, seconds)).collect::<Vec<_>>(),
        ))
    }

    /// Poses of the movers with these indices; the others are absent.
    pub fn some_at(&self, movers: &[usize], seconds: f64) -> Snapshot {
        Snapshot(ObjectTree::new(&movers.iter().map(|number| self.placed(*number, seconds)).collect::<Vec<_>>()))
    }

    /// Indices of the movers within `reach_m` of a point.
    pub fn movers_near(&self, point: &Vec3, reach_m: f32, seconds: f64) -> Vec<usize> {
        let is_near = |number: &usize| {
            let placed = self.placed(*number, seconds);
            (placed.center - point).norm() < reach_m + placed.radius
        };
        (0..self.movers.len()).filter(is_near).collect()
    }

    /// The nearest hit before `max_m`.
    pub fn cast(&self, snapshot: &Snapshot, ray: &Ray, max_m: f32) -> Option<SceneHit> {
        self.cast_on(snapshot, ray, max_m, self.statics.nearest(ray, max_m))
    }

    /// [`Scene::cast`] of many rays, ray i at the time of `snapshot(i)`. Several times as fast if consecutive rays are
    /// coherent.
    pub fn cast_all<'s>(
        &self,
        rays: &[Ray],
        max_m: f32,
        snapshot: impl Fn(usize) -> &'s Snapshot,
    ) -> Vec<Option<SceneHit>> {
        let static_hits = self.statics.nearest_of(rays, max_m);
        let limit = |i: usize| static_hits[i].map_or(max_m, |(range, _)| range);
        let may_hit_mover = Snapshot::may_meet(&snapshot, rays, limit);
        let hit = |(i, ray): (usize, &Ray)| {
            if may_hit_mover[i] {
                return self.cast_on(snapshot(i), ray, max_m, static_hits[i]);
            }
            static_hits[i].map(|(range, primitive)| self.hit(ray, range, primitive))
        };
        rays.iter().enumerate().map(hit).collect()
    }

    /// The nearest of the mover hits and the hit in the static scene.
    fn cast_on(
        &self,
        snapshot: &Snapshot,
        ray: &Ray,
        max_m: f32,
        static_hit: Option<(f32, &Primitive)>,
    ) -> Option<SceneHit> {
        let limit = static_hit.map_or(max_m, |(range, _)| range);
        let mut best = static_hit.map(|(range, primitive)| self.hit(ray, range, primitive));
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

    /// Whether the ray hits anything before `max_m`.
    pub fn is_blocked(&self, snapshot: &Snapshot, ray: &Ray, max_m: f32) -> bool {
        self.statics.any(ray, max_m) || self.is_blocked_by_mover(snapshot, ray, max_m)
    }

    /// Whether the ray hits a mover before `max_m`.
    fn is_blocked_by_mover(&self, snapshot: &Snapshot, ray: &Ray, max_m: f32) -> bool {
        let mut is_blocked = false;
        snapshot.0.visit(ray, max_m, |placed, local, limit| {
            is_blocked = self.movers[placed.number].models[placed.phase].any(local, *limit);
            is_blocked
        });
        is_blocked
    }

    /// [`Scene::is_blocked`] for many rays, as in [`Scene::cast_all`].
    pub fn are_blocked<'s>(&self, rays: &[Ray], max_m: f32, snapshot: impl Fn(usize) -> &'s Snapshot) -> Vec<bool> {
        let mut blocked = self.statics.any_of(rays, max_m);
        let may_hit_mover = Snapshot::may_meet(&snapshot, rays, |i| if blocked[i] { -1.0 } else { max_m });
        for (i, ray) in rays.iter().enumerate() {
            blocked[i] |= may_hit_mover[i] && self.is_blocked_by_mover(snapshot(i), ray, max_m);
        }
        blocked
    }

    /// The static primitives.
    pub fn statics(&self) -> &Bvh {
        &self.statics
    }

    /// A copy of the scene with other classes and instances: `label` maps the old ones to the new ones.
    #[must_use]
    pub fn relabeled(mut self, label: impl Fn(ClassId, u16) -> (ClassId, u16)) -> Self {
        for surface in &mut self.surfaces {
            (surface.class, surface.instance) = label(surface.class, surface.instance);
        }
        self
    }

    /// The moving objects.
    pub fn movers(&self) -> &[Mover] {
        &self.movers
    }

    /// Number of primitives, static and moving.
    pub fn n_primitives(&self) -> usize {
        self.statics.len() + self.movers.iter().flat_map(|mover| &mover.models).map(Bvh::len).sum::<usize>()
    }

    fn placed(&self, number: usize, seconds: f64) -> PlacedObject {
        let mover = &self.movers[number];
        let world_from_object = mover.pose(seconds);
        let center = (world_from_object * Point3::from(mover.center)).coords;
        PlacedObject { number, phase: mover.phase(seconds), world_from_object, center, radius: mover.radius }
    }

    #[inline]
    fn hit(&self, ray: &Ray, range_m: f32, primitive: &Primitive) -> SceneHit {
        SceneHit {
            range_m,
            normal: primitive.shape.normal(ray, range_m),
            surface: self.surfaces[primitive.surface as usize],
            texture_point: ray.at(range_m),
        }
    }
}
