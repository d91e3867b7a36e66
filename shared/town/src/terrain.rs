//! Terrain: a height at every position, with bounded slopes.

use crate::noise::rough;
use nalgebra::Vector2;
use random::Random;
use std::f64::consts::TAU;

/// Steepest slope of the hilliest town, m/m.
pub const MAX_SLOPE: f64 = 0.06;
/// Half of the unevenness of paved ground, m.
const UNEVEN_M: f32 = 0.018;

/// Gentle hills: a sum of sines, so that all derivatives exist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terrain {
    swells: [Swell; 4],
    seed: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Swell {
    /// Direction and wave number, rad/m.
    wave: Vector2<f64>,
    phase: f64,
    height_m: f64,
}

impl Terrain {
    /// Hills for a seed: from nearly flat to slopes of [`MAX_SLOPE`].
    pub fn new(seed: u64) -> Self {
        let mut random = Random::for_hashed_stream(seed, 0x07e2_2a14);
        let steepness = MAX_SLOPE * f64::from(random.range(0.25, 1.0));
        // Shares of the slope that add up to 1; the shorter waves get smaller shares.
        let swells = [(0.4, 420.0), (0.3, 310.0), (0.2, 240.0), (0.1, 170.0)].map(|(share, length_m)| {
            let angle = f64::from(random.range(0.0, TAU as f32));
            let rate = TAU / (length_m * f64::from(random.range(0.9, 1.15)));
            Swell {
                wave: Vector2::new(angle.cos(), angle.sin()) * rate,
                phase: f64::from(random.range(0.0, TAU as f32)),
                height_m: steepness * share / rate,
            }
        });
        Self { swells, seed }
    }
    /// Height, m.
    pub fn height(&self, p: &Vector2<f64>) -> f64 {
        self.swells.iter().map(|s| s.height_m * (s.wave.dot(p) + s.phase).sin()).sum()
    }
    /// Slope towards east and north, m/m.
    pub fn gradient(&self, p: &Vector2<f64>) -> Vector2<f64> {
        self.swells.iter().map(|s| s.wave * (s.height_m * (s.wave.dot(p) + s.phase).cos())).sum()
    }
    /// Deviation of paved ground from its smooth shape, m: 3.6 cm from the deepest rut to the highest point.
    pub fn uneven(&self, p: &Vector2<f64>) -> f64 {
        f64::from(UNEVEN_M * rough(self.seed, p.x as f32, p.y as f32, 3.1, 0.9))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terrain_gradient_is_bounded_and_matches_heights() {
        let mut steepest = 0.0_f64;
        for seed in 0..20 {
            let terrain = Terrain::new(seed);
            for i in 0..200 {
                let p = Vector2::new(f64::from(i) * 7.3, f64::from(i % 13) * -31.0);
                let gradient = terrain.gradient(&p);
                let numeric = Vector2::new(1e-4, 0.0);
                let east = (terrain.height(&(p + numeric)) - terrain.height(&(p - numeric))) / 2e-4;
                assert!((gradient.x - east).abs() < 1e-6);
                assert!(gradient.norm() <= MAX_SLOPE);
                steepest = steepest.max(gradient.norm());
            }
        }
        assert!(steepest > 0.03, "some towns are hilly: {steepest}");
    }
}
