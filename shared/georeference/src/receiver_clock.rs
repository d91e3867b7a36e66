//! Estimates the delay of the stamps of a GNSS receiver, by comparing its Doppler velocities with the odometry.
//!
//! Speed and course change when the vehicle accelerates and turns; the receiver must report the change at the same time.

use crate::antenna_track::AntennaTrack;
use crate::fixes::UsedFix;
use nalgebra::Vector2;

/// Step of the tested delays, s.
const STEP_S: f64 = 0.05;
/// Number of velocities that share a heading of the odometry: about half a minute, in which the heading drifts by less
/// than the velocity errors.
const WINDOW: usize = 32;
/// Residuals are limited to this many standard deviations.
const MAX_RESIDUAL: f64 = 4.0;
/// With fewer velocities the delay is undetermined.
const MIN_VELOCITIES: usize = 10;
/// A delay is corrected if it is at least this many standard deviations and at least this long, s: at 10 m/s shorter
/// delays move fixes by less than 20 cm.
const MIN_SIGNIFICANCE: f64 = 4.0;
const MIN_DELAY_S: f64 = 0.02;

/// Delay of the stamps of a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReceiverDelay {
    /// Delay of the stamps relative to the positions, s; negative if they are early.
    pub late_s: f64,
    /// Standard deviation, s.
    pub sigma_s: f64,
}

impl ReceiverDelay {
    /// Whether the delay is beyond the estimated range; it is then not corrected.
    pub fn is_out_of_range(&self) -> bool {
        self.late_s.abs() > AntennaTrack::HALF_SPAN_S - 1.5 * STEP_S
    }
    /// Whether it exceeds the noise.
    pub(crate) fn is_significant(&self) -> bool {
        self.late_s.abs() > MIN_DELAY_S && self.late_s.abs() > MIN_SIGNIFICANCE * self.sigma_s
    }
}

/// The delay, if the velocities show one. It is also returned if it is out of range.
pub(crate) fn receiver_delay(fixes: &[UsedFix]) -> Option<ReceiverDelay> {
    let is_at_the_end = |delay: &ReceiverDelay| delay.late_s.abs() == AntennaTrack::HALF_SPAN_S;
    estimated_delay(fixes).filter(|delay| is_at_the_end(delay) || delay.is_significant())
}

/// The delay, however small; `None` without enough velocities, or if they do not change. Delays out of range are at its end.
pub(crate) fn estimated_delay(fixes: &[UsedFix]) -> Option<ReceiverDelay> {
    let fixes: Vec<&UsedFix> = fixes.iter().filter(|fix| fix.velocity.is_some()).collect();
    if fixes.len() < MIN_VELOCITIES {
        return None;
    }
    let n_side = (AntennaTrack::HALF_SPAN_S / STEP_S).round() as i32;
    let costs: Vec<f64> = (-n_side..=n_side).map(|k| cost(&fixes, f64::from(k) * STEP_S)).collect();
    let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
    if best == 0 || best == costs.len() - 1 {
        // The range ends before the best delay. Without changes of velocity all delays have about the same cost.
        let is_better = costs[n_side as usize] - costs[best] > MIN_SIGNIFICANCE.powi(2);
        let late_s = AntennaTrack::HALF_SPAN_S * if best == 0 { -1.0 } else { 1.0 };
        return is_better.then_some(ReceiverDelay { late_s, sigma_s: AntennaTrack::HALF_SPAN_S });
    }
    // A parabola through the best delay and its neighbors.
    let [before, at, after] = [costs[best - 1], costs[best], costs[best + 1]];
    let curvature = before - 2.0 * at + after;
    if curvature <= 0.0 {
        return None;
    }
    let shift = (0.5 * (before - after) / curvature).clamp(-1.0, 1.0);
    // A cost above the number of its components indicates larger velocity errors.
    let per_component = (costs[best] / (2.0 * fixes.len() as f64)).max(1.0);
    let sigma_s = STEP_S * (2.0 * per_component / curvature).sqrt();
    Some(ReceiverDelay { late_s: (best as f64 + shift - f64::from(n_side)) * STEP_S, sigma_s })
}

/// Sum of the squared residuals for stamps that are late by `late_s`. Each window of velocities has its own heading.
fn cost(fixes: &[&UsedFix], late_s: f64) -> f64 {
    fixes.chunks(WINDOW).map(|window| window_cost(window, late_s)).sum()
}

/// Horizontal velocity of the antenna by the odometry and by the receiver, m/s.
#[derive(Clone, Copy)]
struct VelocityPair {
    odom: Vector2<f64>,
    world: Vector2<f64>,
    /// Standard deviation of the receiver's velocity.
    sigma: f64,
}

impl VelocityPair {
    /// `late_s`: delay of the receiver's stamps. `None` if the fix has no velocity.
    fn new(fix: &UsedFix, late_s: f64) -> Option<Self> {
        let velocity = fix.velocity.as_ref()?;
        let odom = fix.antenna.velocity(-late_s).xy();
        Some(Self { odom, world: velocity.vector(), sigma: velocity.sigma_mps })
    }
}

fn window_cost(window: &[&UsedFix], late_s: f64) -> f64 {
    let pairs: Vec<VelocityPair> = window.iter().filter_map(|fix| VelocityPair::new(fix, late_s)).collect();
    let Some(yaw) = yaw_between(pairs.iter().copied()) else { return 0.0 };
    let rotation = nalgebra::Rotation2::new(yaw);
    let residual = |VelocityPair { odom, world, sigma }: &VelocityPair| (rotation * odom - world).norm() / sigma;
    pairs.iter().map(|pair| residual(pair).min(MAX_RESIDUAL).powi(2)).sum()
}

/// Rotation from odom to the world from all velocities, robust against any share of outliers: first from the directions
/// alone, then without outliers.
pub(crate) fn yaw_by_velocities(fixes: &[UsedFix], late_s: f64) -> Option<f64> {
    yaw_between(fixes.iter().filter_map(|fix| VelocityPair::new(fix, late_s)))
}

/// Three rounds of weighted directions; from the second one on without directions beyond some standard deviations.
fn yaw_between(pairs: impl Iterator<Item = VelocityPair>) -> Option<f64> {
    let pairs: Vec<_> = pairs.filter(|pair| pair.odom.norm() > 0.0 && pair.world.norm() > 0.0).collect();
    let mut yaw = None;
    for _ in 0..3 {
        let mut cosine = 0.0;
        let mut sine = 0.0;
        for VelocityPair { odom, world, sigma } in &pairs {
            let weight = yaw.map_or(1.0 / (odom.norm() * world.norm()), |yaw: f64| {
                let off = (nalgebra::Rotation2::new(yaw) * odom - world).norm() / sigma;
                (MAX_RESIDUAL.powi(2) / (off * off + MAX_RESIDUAL.powi(2))).powi(2) / (sigma * sigma)
            });
            cosine += weight * odom.dot(world);
            sine += weight * odom.perp(world);
        }
        yaw = (cosine.hypot(sine) > 0.0).then(|| sine.atan2(cosine));
    }
    yaw
}
