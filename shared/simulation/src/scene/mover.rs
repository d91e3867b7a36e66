//! Things that move: a model and its way at its pace.

use crate::pace::Pace;
use crate::trace::{Bvh, Primitive, Vec3};
use crate::way::Way;
use nalgebra::Isometry3;
use std::sync::Arc;

/// One moving thing.
#[derive(Clone, Debug)]
pub struct Mover {
    /// Its shape in its own frame: on the ground, x forward.
    pub model: Bvh,
    /// Middle of the model, m.
    pub center: Vec3,
    /// The ball around `center` holds the model, m.
    pub radius: f32,
    /// Where it goes.
    pub route: Route,
}

/// A way and when to be where on it.
#[derive(Clone, Debug)]
pub struct Route {
    /// The curve.
    pub way: Arc<Way>,
    /// Beside it, m to the left.
    pub left_m: f64,
    /// Whether it leans with the ground, as vehicles do and people do not.
    pub leans: bool,
    /// When it is where.
    pub timing: Timing,
}

/// When something is where on its way.
#[derive(Clone, Debug)]
pub enum Timing {
    /// At a constant speed, from `from_m` at the drive's begin.
    Steady {
        /// Where on the way, m.
        from_m: f64,
        /// m/s.
        speed_mps: f64,
    },
    /// At a pace that others have too, a length ahead of it (negative = behind): a queue that stands and goes as one.
    Ahead {
        /// The pace.
        pace: Arc<Pace>,
        /// How far ahead, m.
        ahead_m: f64,
    },
    /// At a pace, so much earlier: everyone is as fast at the same place, and slow in turns.
    Earlier {
        /// The pace.
        pace: Arc<Pace>,
        /// How much earlier, s.
        seconds: f64,
    },
    /// Waits at the begin of the way, goes to its end from second `from` on, and waits there.
    Once {
        /// s after the drive's begin.
        from: f64,
        /// m/s.
        speed_mps: f64,
    },
}

impl Mover {
    /// A thing on its way; `None` for a model without primitives.
    pub fn new(model: Vec<Primitive>, route: Route) -> Option<Self> {
        let model = Bvh::new(model);
        let [low, high] = model.bounds()?;
        let (center, radius) = ((low + high) * 0.5, (high - low).norm() * 0.5);
        Some(Self { model, center, radius, route })
    }
    /// `world_from_object`, `seconds` after the drive's begin.
    pub fn pose(&self, seconds: f64) -> Isometry3<f32> {
        self.route.pose(seconds).cast()
    }
}

impl Route {
    /// `world_from_object` at a time.
    pub fn pose(&self, seconds: f64) -> Isometry3<f64> {
        let s = match &self.timing {
            Timing::Steady { from_m, speed_mps } => from_m + speed_mps * seconds,
            Timing::Ahead { pace, ahead_m } => pace.length_m(seconds) + ahead_m,
            Timing::Earlier { pace, seconds: earlier } => pace.length_m(seconds + earlier),
            Timing::Once { from, speed_mps } => (speed_mps * (seconds - from)).clamp(0.0, self.way.length_m() - 1.0),
        };
        if self.leans { self.way.frame(s, self.left_m, 0.0) } else { self.way.upright(s, self.left_m, 0.0) }
    }
}
