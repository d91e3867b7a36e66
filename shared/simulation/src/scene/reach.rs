//! What is worth building: what lies near the driven part of the way.

use crate::way::Way;
use nalgebra::Vector2;

/// Between two places of the way that are looked at, m.
const STEP_M: f64 = 8.0;

/// The driven part of a way.
#[derive(Clone, Debug)]
pub struct Reach {
    places: Vec<Vector2<f64>>,
}

impl Reach {
    /// Of the way from one length to another, m; one round at most.
    pub fn new(way: &Way, from_m: f64, to_m: f64) -> Self {
        let to_m = to_m.min(from_m + way.length_m());
        let n = ((to_m - from_m) / STEP_M).ceil().max(1.0) as usize;
        Self { places: (0..=n).map(|i| way.point(from_m + (to_m - from_m) * i as f64 / n as f64).xy()).collect() }
    }
    /// Distance of a place from the driven part, m, within 1 m beyond 10 m.
    pub fn distance(&self, p: &Vector2<f64>) -> f64 {
        self.places.iter().map(|q| (q - p).norm_squared()).fold(f64::INFINITY, f64::min).sqrt()
    }
    /// Whether a place is that near.
    pub fn is_near(&self, p: &Vector2<f64>, distance_m: f64) -> bool {
        self.places.iter().any(|q| (q - p).norm_squared() < distance_m * distance_m)
    }
    /// Smallest and largest coordinates of what is that near.
    pub fn bounds(&self, distance_m: f64) -> [Vector2<f64>; 2] {
        let first = self.places[0];
        let (low, high) = self.places.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)));
        [low.add_scalar(-distance_m), high.add_scalar(distance_m)]
    }
}
