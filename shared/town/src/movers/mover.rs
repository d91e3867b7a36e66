//! Moving objects: models on a path, with a position on it over time.

use crate::path::GroundPath;
use crate::speed_profile::SpeedProfile;
use nalgebra::Isometry3;
use raytrace::{Bvh, Primitive, Vec3};
use std::sync::Arc;

/// One moving object.
#[derive(Clone, Debug)]
pub struct Mover {
    /// Models in the object's frame (on the ground, x forward): one, or the phases of a walker's stride.
    pub models: Vec<Bvh>,
    /// Distance after which the sequence of models repeats, m.
    stride_m: f64,
    /// Middle of the models, m.
    pub center: Vec3,
    /// Radius of the bounding sphere around `center`, m.
    pub radius: f32,
    /// Its route.
    pub route: Route,
}

/// A path, and the position on it over time.
#[derive(Clone, Debug)]
pub struct Route {
    /// The path.
    pub path: Arc<GroundPath>,
    /// Offset to the left of the path, m.
    pub left_m: f64,
    /// Whether it tilts with the ground, as vehicles do; people stay upright.
    pub leans: bool,
    /// Position over time.
    pub timing: Timing,
}

/// Position on a path over time.
#[derive(Clone, Debug)]
pub enum Timing {
    /// Constant speed, at `from_m` when the drive starts.
    Steady {
        /// Position on the path at the start of the drive, m.
        from_m: f64,
        /// Speed, m/s.
        speed_mps: f64,
    },
    /// A constant distance ahead of a shared speed profile (negative = behind): a queue that stops and starts together.
    Ahead {
        /// The speed profile.
        speed: Arc<SpeedProfile>,
        /// Distance ahead at rest, m.
        ahead_m: f64,
        /// Time shift, s: a queue starts at its front.
        earlier_s: f64,
    },
    /// A shared speed profile, shifted in time: every vehicle has the same speed at the same position.
    Earlier {
        /// The speed profile.
        speed: Arc<SpeedProfile>,
        /// Time shift, s.
        seconds: f64,
    },
    /// Waits at the start of the path, moves to its end starting at second `from`, and waits there.
    Once {
        /// Start, s after the start of the drive.
        from: f64,
        /// m/s.
        speed_mps: f64,
    },
}

impl Mover {
    /// An object with one model; `None` for a model without primitives.
    pub fn new(model: Vec<Primitive>, route: Route) -> Option<Self> {
        Self::striding(vec![model], 1.0, route)
    }
    /// An object that shows its models in turn, the whole sequence once per `stride_m` of path; `None` without
    /// primitives.
    pub fn striding(models: Vec<Vec<Primitive>>, stride_m: f64, route: Route) -> Option<Self> {
        let models: Vec<Bvh> = models.into_iter().map(Bvh::new).collect();
        let [low, high] = hull(&models)?;
        let center = (low + high) * 0.5;
        let radius = (high - low).norm() * 0.5;
        Some(Self { models, stride_m, center, radius, route })
    }
    /// `world_from_object`, `seconds` after the start of the drive.
    pub fn pose(&self, seconds: f64) -> Isometry3<f32> {
        self.route.pose(seconds).cast()
    }
    /// Index of the model that it shows.
    pub fn phase(&self, seconds: f64) -> usize {
        let strides = self.route.distance_m(seconds) / self.stride_m;
        let phase = (strides - strides.floor()) * self.models.len() as f64;
        (phase as usize).min(self.models.len() - 1)
    }
    /// Smallest and largest coordinates of all models, m, in its own frame.
    pub fn bounds(&self) -> [Vec3; 2] {
        hull(&self.models).unwrap_or([self.center; 2])
    }
}

fn hull(models: &[Bvh]) -> Option<[Vec3; 2]> {
    models.iter().filter_map(Bvh::bounds).reduce(|[low, high], [a, b]| [low.inf(&a), high.sup(&b)])
}

impl Route {
    /// `world_from_object` at a time.
    pub fn pose(&self, seconds: f64) -> Isometry3<f64> {
        let s = self.distance_m(seconds);
        if self.leans { self.path.frame(s, self.left_m, 0.0) } else { self.path.upright(s, self.left_m, 0.0) }
    }
    /// Position on the path at a time, m.
    fn distance_m(&self, seconds: f64) -> f64 {
        match &self.timing {
            Timing::Steady { from_m, speed_mps } => from_m + speed_mps * seconds,
            Timing::Ahead { speed, ahead_m, earlier_s } => speed.distance_m(seconds + earlier_s) + ahead_m,
            Timing::Earlier { speed, seconds: earlier } => speed.distance_m(seconds + earlier),
            Timing::Once { from, speed_mps } => (speed_mps * (seconds - from)).clamp(0.0, self.path.length_m() - 1.0),
        }
    }
}
