//! Distance along a path over time: slow in turns, stationary at red lights.

use crate::path::GroundPath;
use crate::spline::Spline;
use nalgebra::SVector;

/// Largest longitudinal acceleration and braking, m/s^2.
const ACCELERATION: f64 = 1.5;
/// Target limit of the lateral acceleration, m/s^2. With smoothing and lane wander it stays below 2.5.
const LATERAL: f64 = 1.9;
/// Knot spacing, s. Speed changes over six knots: the jerk stays below 1.5 m/s^3.
const KNOT_SECONDS: f64 = 0.4;
/// Steps of the simulation between two knots.
const STEPS: usize = 8;
/// Variation of the cruise speed: share, and wavelength in m up to [`FAST_MPS`], which then grows with the square of the
/// speed.
const VARIATION_SHARE: f64 = 0.1;
const VARIATION_M: f64 = 90.0;
/// Cruise speed above which waves along the path are longer, so that accelerations do not grow, m/s.
pub const FAST_MPS: f64 = 13.0;

/// Target speed and stops of a driver.
#[derive(Clone, Debug, PartialEq)]
pub struct Driver {
    /// Speed on straights, m/s; it varies by a tenth.
    pub cruise_mps: f64,
    /// Phase of the speed variation, rad.
    pub phase: f64,
    /// Red lights, by increasing distance.
    pub stops: Vec<Stop>,
}

/// A red light at which a driver waits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Distance along the path, m.
    pub at_m: f64,
    /// Waiting time, s.
    pub seconds: f64,
}

/// Distance along a path over time, with continuous derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedProfile {
    lengths: Spline<1>,
}

impl SpeedProfile {
    /// The speed profile of a drive of `seconds` that starts from rest at `start_m`.
    pub fn from_rest(path: &GroundPath, driver: &Driver, start_m: f64, seconds: f64) -> Self {
        Self::simulate(path, driver, start_m, 0.0, seconds)
    }
    /// The profile of a driver who starts at cruise speed.
    pub fn rolling(path: &GroundPath, driver: &Driver, start_m: f64, seconds: f64) -> Self {
        Self::simulate(path, driver, start_m, driver.cruise_mps, seconds)
    }
    /// Distance along the path, `seconds` after the start, m. It is constant before the start.
    pub fn distance_m(&self, seconds: f64) -> f64 {
        self.lengths.at(seconds / KNOT_SECONDS).x
    }
    /// Time at which `distance_m` is first reached, s; the end of the drive if it is not reached.
    pub fn seconds_at(&self, distance_m: f64) -> f64 {
        let n = self.lengths.len();
        let after = (0..n).find(|i| self.lengths.at(*i as f64).x >= distance_m).unwrap_or(n);
        after as f64 * KNOT_SECONDS
    }

    fn simulate(path: &GroundPath, driver: &Driver, start_m: f64, start_mps: f64, seconds: f64) -> Self {
        let limits = Limits::new(path, driver);
        let mut stops = driver.stops.iter().copied().filter(|stop| stop.at_m > start_m + 1.0).peekable();
        let mut s = start_m;
        let mut speed = start_mps;
        let mut wait = 0.0;
        // The first three knots are equal, so that the vehicle starts at rest.
        let mut lengths = vec![SVector::from([s]); if start_mps > 0.0 { 1 } else { 3 }];
        let step = KNOT_SECONDS / STEPS as f64;
        // Beyond the end by more than the support of the curve.
        for _ in 0..(seconds / KNOT_SECONDS).ceil() as usize + 8 {
            for _ in 0..STEPS {
                if wait > 0.0 {
                    wait -= step;
                    speed = 0.0;
                    continue;
                }
                let mut allowed = limits.at(s);
                if let Some(stop) = stops.peek() {
                    let left = stop.at_m - s;
                    allowed = allowed.min((2.0 * ACCELERATION * left.max(0.0)).sqrt());
                    if left < 0.05 {
                        wait = stop.seconds;
                        s = stop.at_m;
                        stops.next();
                        continue;
                    }
                }
                speed = (speed + ACCELERATION * step).min(allowed);
                s += speed * step;
            }
            lengths.push(SVector::from([s]));
        }
        let lengths = Spline::open(lengths).unwrap_or_else(|| unreachable!("four knots at least"));
        Self { lengths }
    }
}

/// Speed limits per metre of the path that respect both accelerations.
struct Limits {
    mps: Vec<f64>,
}

impl Limits {
    fn new(path: &GroundPath, driver: &Driver) -> Self {
        let n = path.length_m().ceil().max(1.0) as usize;
        let wavelength_m = VARIATION_M * (driver.cruise_mps / FAST_MPS).max(1.0).powi(2);
        let mut mps: Vec<f64> = (0..n)
            .map(|i| {
                let s = i as f64;
                let variation = 1.0 + VARIATION_SHARE * (std::f64::consts::TAU * s / wavelength_m + driver.phase).sin();
                let sharpest = (-3..=3).map(|d| path.curvature(s + f64::from(d)).abs()).fold(1e-6, f64::max);
                (driver.cruise_mps * variation).min((LATERAL / sharpest).sqrt())
            })
            .collect();
        // Limits before slow sections, so that the vehicle can brake; two passes, because the path is closed.
        for i in (0..2 * n).rev() {
            let next: f64 = mps[(i + 1) % n];
            mps[i % n] = mps[i % n].min((next * next + 2.0 * ACCELERATION).sqrt());
        }
        Self { mps }
    }
    fn at(&self, s: f64) -> f64 {
        let n = self.mps.len() as i64;
        let i = s.floor() as i64;
        let t = s - s.floor();
        let at = |i: i64| self.mps[i.rem_euclid(n) as usize];
        at(i) + (at(i + 1) - at(i)) * t
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::Terrain;
    use nalgebra::Vector2;

    /// A round of 1 km with four turns over hills.
    fn example_path() -> GroundPath {
        let corners = [[0.0, 0.0], [300.0, 0.0], [300.0, 200.0], [0.0, 200.0]].map(Vector2::from);
        GroundPath::around(&corners, 4.0, Terrain::new(11)).expect("four corners")
    }

    #[test]
    fn driver_starts_from_rest_slows_in_turns_and_waits_at_red_light() {
        let path = example_path();
        let driver = Driver { cruise_mps: 9.0, phase: 0.3, stops: vec![Stop { at_m: 150.0, seconds: 8.0 }] };
        let profile = SpeedProfile::from_rest(&path, &driver, 20.0, 60.0);
        let speed = |t: f64| (profile.distance_m(t + 1e-3) - profile.distance_m(t - 1e-3)) / 2e-3;
        assert_eq!(profile.distance_m(0.0), 20.0);
        assert!(speed(0.0).abs() < 1e-9);
        let mut fastest = 0.0_f64;
        let mut standing = 0.0;
        for i in 0..600 {
            let t = 0.1 * f64::from(i);
            fastest = fastest.max(speed(t));
            let acceleration = (speed(t + 0.05) - speed(t - 0.05)) / 0.1;
            assert!(acceleration.abs() < 1.9, "{acceleration} at {t} s");
            let sideward = path.curvature(profile.distance_m(t)).abs() * speed(t).powi(2);
            assert!(sideward < 2.2, "{sideward} at {t} s");
            if t > 5.0 && speed(t) < 0.01 {
                standing += 0.1;
                assert!((profile.distance_m(t) - 150.0).abs() < 0.5);
            }
        }
        assert!((8.5..10.0).contains(&fastest), "{fastest}");
        assert!((6.0..10.0).contains(&standing), "{standing} s at the red light");
        assert!((profile.seconds_at(150.0) - 20.0).abs() < 15.0);
    }
}
