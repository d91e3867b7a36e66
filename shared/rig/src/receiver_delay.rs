//! Delay of the stamps of a GNSS receiver: its velocities are compared with the velocities along the LiDAR's path,
//! which change when the vehicle accelerates and turns.

use geometry::{Point3, Stamp};
use nalgebra::{Rotation2, Vector2};
use registration::GroundVelocity;

/// Step and largest value of the tested delays, s.
const STEP_S: f64 = 0.05;
const N_SIDE: usize = 20;
pub(crate) const MAX_DELAY_S: f64 = STEP_S * N_SIDE as f64;
const N_DELAYS: usize = 2 * N_SIDE + 1;
/// Half of the time over which the path gives a velocity: errors of 1 cm become 3 cm/s.
const HALF_NANOS: i64 = 250_000_000;
/// Velocities closer in time have the same errors, s.
const MIN_PAUSE_S: f64 = 0.45;
/// Least speed with a reliable course, m/s.
const MIN_SPEED_MPS: f64 = 1.0;
/// Time for which velocities share a heading of the path, s: the heading drifts by less than the velocity errors.
const WINDOW_S: f64 = 30.0;
/// With fewer velocities the delay is undetermined.
const MIN_VELOCITIES: usize = 6;
/// Residuals are limited to this many standard deviations.
const MAX_RESIDUAL: f64 = 4.0;
/// With a larger standard deviation the delay is undetermined, s.
const MAX_SIGMA_S: f64 = 0.1;

/// Delay of the stamps of a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ReceiverDelay {
    /// Delay of the stamps relative to the measurements, s; negative if they are early.
    pub late_s: f64,
    /// Standard deviation, s.
    pub sigma_s: f64,
}

/// Reason why the velocities do not determine a delay.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum NoDelay {
    #[error("{n} fixes with speed and course above {MIN_SPEED_MPS} m/s, {MIN_VELOCITIES} are needed")]
    FewVelocities { n: usize },
    #[error("the vehicle accelerated and turned too little")]
    EvenMotion,
    #[error("no delay up to {MAX_DELAY_S} s fits best; check the clock of the receiver")]
    BeyondRange,
}

/// A velocity from the receiver, and the velocities along the path for each tested delay of its stamp.
struct Pair {
    stamp: Stamp,
    world: Vector2<f64>,
    sigma: f64,
    odom: [Vector2<f64>; N_DELAYS],
}

/// Estimates the delay. `antenna_in_odom` is the path of the antenna from the LiDAR odometry.
pub(crate) fn receiver_delay(
    velocities: impl Iterator<Item = GroundVelocity>,
    antenna_in_odom: impl Fn(Stamp) -> Option<Point3<f64>>,
) -> Result<ReceiverDelay, NoDelay> {
    let mut pairs: Vec<Pair> = Vec::new();
    for velocity in velocities {
        let is_soon = pairs.last().is_some_and(|last| velocity.stamp.seconds_since(last.stamp) < MIN_PAUSE_S);
        if !is_soon {
            pairs.extend(Pair::new(&velocity, &antenna_in_odom));
        }
    }
    if pairs.len() < MIN_VELOCITIES {
        return Err(NoDelay::FewVelocities { n: pairs.len() });
    }
    let begin = pairs[0].stamp;
    let window_of = |pair: &Pair| (pair.stamp.seconds_since(begin) / WINDOW_S) as u64;
    let windows: Vec<&[Pair]> = pairs.chunk_by(|a, b| window_of(a) == window_of(b)).collect();
    let cost = |delay: usize| windows.iter().map(|window| window_cost(window, delay)).sum();
    let costs: Vec<f64> = (0..N_DELAYS).map(cost).collect();
    let best = (0..N_DELAYS).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(N_SIDE);
    // A cost above the number of components indicates larger velocity errors than stated.
    let n_components = (2 * pairs.len() - windows.len()) as f64;
    let unit = (costs[best] / n_components).max(1.0);
    if best == 0 || best == N_DELAYS - 1 {
        let is_better = costs[N_SIDE] - costs[best] > MAX_RESIDUAL.powi(2) * unit;
        return Err(if is_better { NoDelay::BeyondRange } else { NoDelay::EvenMotion });
    }
    // A parabola through the best delay and its neighbors.
    let [before, at, after] = [costs[best - 1], costs[best], costs[best + 1]];
    let curvature = before - 2.0 * at + after;
    let sigma_s = STEP_S * (2.0 * unit / curvature.max(0.0)).sqrt();
    if sigma_s > MAX_SIGMA_S {
        return Err(NoDelay::EvenMotion);
    }
    let late_s = (best as f64 - N_SIDE as f64 + 0.5 * (before - after) / curvature) * STEP_S;
    Ok(ReceiverDelay { late_s, sigma_s })
}

impl Pair {
    /// Creates a pair; `None` if the velocity has no direction, or the path does not cover all delays.
    fn new(velocity: &GroundVelocity, antenna_in_odom: &impl Fn(Stamp) -> Option<Point3<f64>>) -> Option<Self> {
        let world = Vector2::from(velocity.east_north);
        if world.norm() < MIN_SPEED_MPS {
            return None;
        }
        let mut odom = [Vector2::zeros(); N_DELAYS];
        for (delay, odom) in odom.iter_mut().enumerate() {
            let late_nanos = ((delay as f64 - N_SIDE as f64) * STEP_S * 1e9) as i64;
            let measured = velocity.stamp.plus_nanos(-late_nanos);
            let [before, after] = [-HALF_NANOS, HALF_NANOS].map(|nanos| antenna_in_odom(measured.plus_nanos(nanos)));
            *odom = (after? - before?).xy() / (2e-9 * HALF_NANOS as f64);
        }
        Some(Self { stamp: velocity.stamp, world, sigma: velocity.sigma, odom })
    }

    /// Residual in standard deviations, for odometry axes that are rotated by `yaw` relative to the world.
    fn residual(&self, delay: usize, yaw: f64) -> f64 {
        (Rotation2::new(yaw) * self.odom[delay] - self.world).norm() / self.sigma
    }
}

/// Sum of the squared residuals with the best-fitting heading.
fn window_cost(window: &[Pair], delay: usize) -> f64 {
    // First from all directions alone; then with less weight on outliers.
    let mut yaw = yaw_of(window, delay, |pair| 1.0 / (pair.world.norm() * pair.odom[delay].norm().max(f64::EPSILON)));
    for _ in 0..3 {
        let from = yaw;
        let weight = |pair: &Pair| (1.0 + (pair.residual(delay, from) / MAX_RESIDUAL).powi(2)).powi(-2);
        yaw = yaw_of(window, delay, |pair| weight(pair) / pair.sigma.powi(2));
    }
    window.iter().map(|pair| pair.residual(delay, yaw).min(MAX_RESIDUAL).powi(2)).sum()
}

fn yaw_of(window: &[Pair], delay: usize, weight: impl Fn(&Pair) -> f64) -> f64 {
    let mut cosine = 0.0;
    let mut sine = 0.0;
    for pair in window {
        let weight = weight(pair);
        cosine += weight * pair.odom[delay].dot(&pair.world);
        sine += weight * pair.odom[delay].perp(&pair.world);
    }
    sine.atan2(cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute of braking, acceleration and turns, in odom axes.
    fn path(stamp: Stamp) -> Option<Point3<f64>> {
        let s = stamp.0 as f64 * 1e-9;
        let along = 8.0 * s - 12.0 * (s / 4.0).cos();
        (0.0..=60.0).contains(&s).then(|| Point3::new(along, 20.0 * (s / 7.0).sin(), 0.0))
    }

    fn straight(stamp: Stamp) -> Option<Point3<f64>> {
        (stamp.0 >= 0).then(|| Point3::new(stamp.0 as f64 * 8e-9, 0.0, 0.0))
    }

    /// Velocities that are `late_s` late in a world rotated by one radian, with errors of 0.1 m/s and some outliers.
    fn velocities(late_s: f64, of_path: fn(Stamp) -> Option<Point3<f64>>) -> Vec<GroundVelocity> {
        let mut random = random::Random::new(7);
        let late_nanos = (late_s * 1e9) as i64;
        let mut found = Vec::new();
        for k in 2..58 {
            let measured = Stamp(k * 1_000_000_000);
            let [a, b] = [-1_000_000, 1_000_000].map(|nanos| of_path(measured.plus_nanos(nanos)).expect("is inside"));
            let mut velocity = Rotation2::new(1.0) * (b - a).xy() / 2e-3;
            velocity += 0.1 * Vector2::new(random.gauss(), random.gauss()).cast();
            if k % 17 == 5 {
                velocity *= 1.4;
            }
            let stamp = measured.plus_nanos(late_nanos);
            found.push(GroundVelocity { stamp, east_north: velocity.into(), sigma: 0.1, late_sigma_s: 0.0 });
        }
        found
    }

    #[test]
    fn delay_of_the_stamps_is_found_within_its_deviation() {
        for planted in [-0.6, -0.04, 0.0, 0.2, 0.83] {
            let found = receiver_delay(velocities(planted, path).into_iter(), path).expect("observable");
            let off = (found.late_s - planted).abs();
            assert!(found.sigma_s < 0.05 && off < 3.0 * found.sigma_s, "{planted}: {found:?}");
        }
    }

    #[test]
    fn delay_that_is_not_observable_has_a_reason() {
        let none = receiver_delay(velocities(0.3, straight).into_iter(), straight);
        assert_eq!(none, Err(NoDelay::EvenMotion));
        let few = velocities(0.0, path).into_iter().take(5);
        assert_eq!(receiver_delay(few, path), Err(NoDelay::FewVelocities { n: 5 }));
        assert_eq!(receiver_delay(velocities(1.6, path).into_iter(), path), Err(NoDelay::BeyondRange));
    }
}
