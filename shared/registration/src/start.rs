//! The first two sweeps: the vehicle may already be under way, and nothing says how fast.
//!
//! A match from rest can lock onto a wrong wall when the vehicle starts at 10 m/s. So several speeds along the
//! vehicle's forward axis are tried; each speed deskews *both* sweeps, and the one under which they agree best wins.

use crate::maps::Maps;
use crate::matching::{MatchSettings, Matched, Prediction, match_features};
use crate::motion::Velocity;
use crate::odometry::HeldSweep;
use crate::sensors::SensorLog;
use crate::{SensorPlaces, SweepMotion};
use geometry::{Isometry3, Pose, Stamp, Translation3, UnitQuaternion, Vector3};
use nalgebra::Matrix6;

/// Ways between two sweeps that are tried, m: steps of 0.4 m, inside the search radius of a match; 3.2 m in 0.1 s are
/// 32 m/s, and backwards up to 8 m/s.
const WAYS_M: [f64; 11] = [0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2, -0.4, -0.8];
/// A vehicle stands unless another speed fits better by more than this. In a tunnel speeds fit alike; a car at 8 m/s between houses
/// (KITTI raw 0048) fits 15 % better at its own.
const REST_ADVANTAGE: f64 = 0.9;
/// Rounds of rebuilding the first sweep with the speed found; the error shrinks by a factor of ten or more in each.
const REFINEMENTS: usize = 3;
/// A receiver's velocity holds for so long, s.
const TOLD_SECONDS: f64 = 0.5;

/// How the drive began.
pub(crate) struct Start {
    /// Motion over the first sweep.
    pub first: SweepMotion,
    /// The second sweep on the first.
    pub second: Matched,
}

/// What other sensors say of the motion between the first two sweeps.
pub(crate) struct FirstMotion {
    /// The lidar's axes, rad/s; zero if nothing is known.
    pub angular: Vector3<f64>,
    /// Over ground, m/s.
    pub speed: Option<f64>,
}

impl FirstMotion {
    pub fn of(log: &SensorLog, [begin, end]: [Stamp; 2], places: &SensorPlaces) -> Self {
        let felt = log.mean(begin, end).filter(|_| log.covers(begin, end));
        let lidar_from_body = places.body_from_lidar.rotation.inverse();
        let angular = felt.map_or_else(Vector3::zeros, |(_, rate)| lidar_from_body * rate);
        let heard = log.velocity_at(end).filter(|velocity| end.seconds_since(velocity.stamp) < TOLD_SECONDS);
        Self { angular, speed: heard.map(crate::GroundVelocity::speed) }
    }
}

/// Finds the motion over two sweeps, `seconds` between their middles, the first of which begins at `begin`, by the speed along
/// odom's x axis under which they agree best, or at the speed that was told. `None` if none brings them together.
pub(crate) fn find_start(
    first: &HeldSweep,
    second: &HeldSweep,
    seconds: f64,
    begin: &Pose,
    told: &FirstMotion,
    settings: &MatchSettings,
) -> Option<Start> {
    let forward_in_lidar = begin.rotation.inverse() * Vector3::x();
    let attempt = |velocity: Velocity| {
        let motion = motion_from_begin(begin, &velocity, first.duration_s);
        let maps = Maps::of_sweep(&first.features, &motion);
        let mid = velocity.advance(&motion.mid, seconds);
        let prediction = Prediction {
            motion: velocity.motion_at(mid, second.duration_s),
            previous: (motion.mid, seconds),
            duration_s: second.duration_s,
            information: Matrix6::zeros(),
        };
        let second = match_features(&second.matching, &maps, &prediction, settings)?;
        Some(Start { first: motion, second })
    };
    let at_speed = |speed: f64| attempt(Velocity { linear: forward_in_lidar * speed, angular: told.angular });
    let search = || {
        let starts = WAYS_M.iter().filter_map(|way_m| Some((*way_m, at_speed(way_m / seconds)?)));
        // Where the scene does not tell the speed, noise decides between equals.
        let cost = |(way_m, start): &(f64, Start)| start.second.cost * if *way_m == 0.0 { REST_ADVANTAGE } else { 1.0 };
        starts.min_by(|a, b| cost(a).total_cmp(&cost(b))).map(|(_, start)| start)
    };
    let mut best = told.speed.and_then(at_speed).or_else(search)?;
    for _ in 0..REFINEMENTS {
        let velocity = Velocity::between(&best.first.mid, &best.second.motion.mid, seconds);
        best = attempt(velocity)?;
    }
    Some(best)
}

/// The motion at constant velocity that starts at `begin`.
fn motion_from_begin(begin: &Pose, velocity: &Velocity, duration_s: f64) -> SweepMotion {
    let rotation = velocity.angular * duration_s;
    let mid_rotation = begin.rotation * UnitQuaternion::from_scaled_axis(rotation * 0.5);
    let translation = mid_rotation * velocity.linear * duration_s;
    let mid_position = begin.translation.vector + translation * 0.5;
    SweepMotion { mid: Isometry3::from_parts(Translation3::from(mid_position), mid_rotation), translation, rotation }
}
