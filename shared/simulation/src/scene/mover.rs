//! Things that move: a model and its way along the street.

use super::ground;
use super::street::Street;
use crate::motion::Progress;
use crate::trace::{Bvh, Primitive, Vec3};
use nalgebra::Isometry3;

/// One moving thing.
#[derive(Clone, Debug)]
pub struct Mover {
    /// Its shape in its own frame: on the ground, x forward.
    pub model: Bvh,
    /// Middle of the model, m.
    pub center: Vec3,
    /// The ball around `center` holds the model, m.
    pub radius: f32,
    /// Its way.
    pub route: Route,
}

/// A way along the street.
#[derive(Clone, Copy, Debug)]
pub enum Route {
    /// At constant speed: x and distance from the center line at the begin (m), height of the ground there (m), speed along
    /// x (m/s, negative = against it).
    Steady {
        /// x at the begin.
        x: f64,
        /// Left of the center line.
        t: f64,
        /// Above the center line.
        h: f64,
        /// Along x.
        speed_mps: f64,
    },
    /// Ahead of the recording vehicle (negative = behind), with its speed and a slow drift of `drift_m`.
    Convoy {
        /// The vehicle's way.
        progress: Progress,
        /// How far ahead.
        ahead_m: f64,
        /// How much the distance changes.
        drift_m: f64,
        /// Left of the center line.
        t: f64,
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
    pub fn pose(&self, street: &Street, seconds: f64) -> Isometry3<f32> {
        let frame = match self.route {
            Route::Steady { x, t, h, speed_mps } => {
                let yaw = if speed_mps < 0.0 { std::f64::consts::PI } else { 0.0 };
                street.frame(x + speed_mps * seconds, t, h, yaw)
            }
            Route::Convoy { progress, ahead_m, drift_m, t } => {
                let drift = drift_m * (0.35 * seconds).sin();
                street.frame(progress.x(seconds) + ahead_m + drift, t, f64::from(ground::road_height(t as f32)), 0.0)
            }
        };
        frame.cast()
    }
}
