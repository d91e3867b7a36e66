//! How far along its way a vehicle is at a time: gentle in turns, and standing at red lights.

use crate::spline::Spline;
use crate::way::Way;
use nalgebra::SVector;

/// Strongest speeding up and braking, m/s^2.
const ACCELERATION: f64 = 1.5;
/// Strongest acceleration to the side, m/s^2; smoothing and the vehicle's wander stay below 2.5.
const SIDEWARD: f64 = 1.9;
/// Between two knots of the pace, s. Speed changes over six of them: no jerk beyond 1.5 m/s^3.
const KNOT_SECONDS: f64 = 0.4;
/// The speed swells by this share, in waves of this length.
const SWELL: (f64, f64) = (0.1, 90.0);

/// What a driver aims at.
#[derive(Clone, Debug, PartialEq)]
pub struct Driver {
    /// Speed where the way is straight, m/s; it swells by a tenth.
    pub cruise_mps: f64,
    /// Shifts the swell, rad.
    pub phase: f64,
    /// Red lights: place on the way (m, growing) and time to wait there (s).
    pub stops: Vec<(f64, f64)>,
}

/// Length of way by time, with continuous derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Pace {
    lengths: Spline<1>,
}

impl Pace {
    /// The pace of a driver who stands at `start_m` at second 0 and drives for `seconds`.
    pub fn from_rest(way: &Way, driver: &Driver, start_m: f64, seconds: f64) -> Self {
        Self::simulate(way, driver, start_m, 0.0, seconds)
    }
    /// The pace of a driver who comes at full speed.
    pub fn rolling(way: &Way, driver: &Driver, start_m: f64, seconds: f64) -> Self {
        Self::simulate(way, driver, start_m, driver.cruise_mps, seconds)
    }
    /// Length of way, `seconds` after the begin, m. It rests before.
    pub fn length_m(&self, seconds: f64) -> f64 {
        self.lengths.at(seconds / KNOT_SECONDS).x
    }
    /// When it comes to `length_m` first, s; the end of the drive if it does not.
    pub fn seconds_at(&self, length_m: f64) -> f64 {
        let n = self.lengths.len();
        let after = (0..n).find(|i| self.lengths.at(*i as f64).x >= length_m).unwrap_or(n);
        after as f64 * KNOT_SECONDS
    }

    fn simulate(way: &Way, driver: &Driver, start_m: f64, start_mps: f64, seconds: f64) -> Self {
        let limits = Limits::new(way, driver);
        let mut stops = driver.stops.iter().copied().filter(|(at, _)| *at > start_m + 1.0).peekable();
        let (mut s, mut speed, mut wait) = (start_m, start_mps, 0.0);
        // The first knots rest, so that a standing start is one.
        let mut lengths = vec![SVector::from([s]); if start_mps > 0.0 { 1 } else { 4 }];
        // Steps much shorter than the knots; past the end by more than the curve's reach.
        const STEPS: usize = 8;
        let step = KNOT_SECONDS / STEPS as f64;
        for _ in 0..(seconds / KNOT_SECONDS).ceil() as usize + 8 {
            for _ in 0..STEPS {
                if wait > 0.0 {
                    wait -= step;
                    speed = 0.0;
                    continue;
                }
                let mut allowed = limits.at(s);
                if let Some((at, seconds)) = stops.peek() {
                    let left = at - s;
                    allowed = allowed.min((2.0 * ACCELERATION * left.max(0.0)).sqrt());
                    if left < 0.05 {
                        (wait, s) = (*seconds, *at);
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

/// Speeds that keep both accelerations, per m of one round.
struct Limits {
    mps: Vec<f64>,
}

impl Limits {
    fn new(way: &Way, driver: &Driver) -> Self {
        let n = way.length_m().ceil().max(1.0) as usize;
        let mut mps: Vec<f64> = (0..n)
            .map(|i| {
                let s = i as f64;
                let swell = 1.0 + SWELL.0 * (std::f64::consts::TAU * s / SWELL.1 + driver.phase).sin();
                let sharpest = (-3..=3).map(|d| way.curvature(s + f64::from(d)).abs()).fold(1e-6, f64::max);
                (driver.cruise_mps * swell).min((SIDEWARD / sharpest).sqrt())
            })
            .collect();
        // Brake in time; twice round, for the seam of a closed way.
        for i in (0..2 * n).rev() {
            let next: f64 = mps[(i + 1) % n];
            mps[i % n] = mps[i % n].min((next * next + 2.0 * ACCELERATION).sqrt());
        }
        Self { mps }
    }
    fn at(&self, s: f64) -> f64 {
        let n = self.mps.len() as i64;
        let (i, t) = (s.floor() as i64, s - s.floor());
        let at = |i: i64| self.mps[i.rem_euclid(n) as usize];
        at(i) + (at(i + 1) - at(i)) * t
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::example_way;

    #[test]
    fn a_driver_starts_from_rest_slows_in_turns_and_waits_at_red() {
        let way = example_way();
        let driver = Driver { cruise_mps: 9.0, phase: 0.3, stops: vec![(150.0, 8.0)] };
        let pace = Pace::from_rest(&way, &driver, 20.0, 60.0);
        let speed = |t: f64| (pace.length_m(t + 1e-3) - pace.length_m(t - 1e-3)) / 2e-3;
        assert_eq!(pace.length_m(0.0), 20.0);
        assert!(speed(0.0).abs() < 1e-9);
        let (mut fastest, mut standing) = (0.0_f64, 0.0);
        for i in 0..600 {
            let t = 0.1 * f64::from(i);
            fastest = fastest.max(speed(t));
            let acceleration = (speed(t + 0.05) - speed(t - 0.05)) / 0.1;
            assert!(acceleration.abs() < 1.9, "{acceleration} at {t} s");
            let sideward = way.curvature(pace.length_m(t)).abs() * speed(t).powi(2);
            assert!(sideward < 2.2, "{sideward} at {t} s");
            if t > 5.0 && speed(t) < 0.01 {
                standing += 0.1;
                assert!((pace.length_m(t) - 150.0).abs() < 0.5);
            }
        }
        assert!((8.5..10.0).contains(&fastest), "{fastest}");
        assert!((6.0..10.0).contains(&standing), "{standing} s at the red light");
        assert!((pace.seconds_at(150.0) - 20.0).abs() < 15.0);
    }
}
