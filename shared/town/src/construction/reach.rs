//! The neighborhood of the driven path, outside which nothing is built.

use crate::path::GroundPath;
use nalgebra::Vector2;

/// Towns are built in detail up to this distance from the driven path, m.
pub const DETAIL_RADIUS_M: f64 = 105.0;
/// Spacing of the sample points on the path, m.
const STEP_M: f64 = 8.0;

/// Sample points of the driven part of a path.
#[derive(Clone, Debug)]
pub struct Reach {
    places: Vec<Vector2<f64>>,
}

impl Reach {
    /// The part of the path between two distances along it, m; at most one round.
    pub fn new(path: &GroundPath, from_m: f64, to_m: f64) -> Self {
        let to_m = to_m.min(from_m + path.length_m());
        let n = ((to_m - from_m) / STEP_M).ceil().max(1.0) as usize;
        Self { places: (0..=n).map(|i| path.point(from_m + (to_m - from_m) * i as f64 / n as f64).xy()).collect() }
    }
    /// Distance of a point from the driven part, m; accurate to 1 m beyond 10 m.
    pub fn distance(&self, p: &Vector2<f64>) -> f64 {
        self.places.iter().map(|q| (q - p).norm_squared()).fold(f64::INFINITY, f64::min).sqrt()
    }
    /// Whether a point is within `distance_m`.
    pub fn is_near(&self, p: &Vector2<f64>, distance_m: f64) -> bool {
        self.places.iter().any(|q| (q - p).norm_squared() < distance_m * distance_m)
    }
    /// Smallest and largest coordinates of points within `distance_m`.
    pub fn bounds(&self, distance_m: f64) -> [Vector2<f64>; 2] {
        let first = self.places[0];
        let (low, high) = self.places.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)));
        [low.add_scalar(-distance_m), high.add_scalar(distance_m)]
    }
}
