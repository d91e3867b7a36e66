//! The first two sweeps: the vehicle may already be under way, and nothing says how fast.
//!
//! A match from rest can lock onto a wrong wall when the vehicle starts at 10 m/s. So several speeds along the
//! vehicle's forward axis are tried; each speed deskews *both* sweeps, and the one under which they agree best wins.

use crate::covariance::step_information;
use crate::maps::Maps;
use crate::matching::{MatchSettings, Matched, Prediction, match_features};
use crate::motion::Velocity;
use crate::odometry::HeldSweep;
use crate::{MeasuredMotion, SweepMotion};
use geometry::{Isometry3, Pose, Translation3, UnitQuaternion, Vector3};
use nalgebra::Matrix6;

/// Ways between two sweeps that are tried, m: steps of 0.4 m, inside the search radius of a match; 3.2 m in 0.1 s are
/// 32 m/s, and backwards up to 8 m/s.
const WAYS_M: [f64; 11] = [0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2, -0.4, -0.8];
/// Rounds of rebuilding the first sweep with the speed found; the error shrinks by a factor of ten or more in each.
const REFINEMENTS: usize = 3;

/// How the drive began.
pub(crate) struct Start {
    /// Motion over the first sweep.
    pub first: SweepMotion,
    /// The second sweep on the first.
    pub second: Matched,
}

/// Finds the motion over two sweeps, `seconds` between their middles, the first of which begins at `begin`.
/// `forward` is the vehicle's forward axis in the odom frame. `None` if no speed brings them together. A measured motion
/// leaves nothing to search.
pub(crate) fn find_start(
    first: &HeldSweep,
    second: &HeldSweep,
    seconds: f64,
    begin: &Pose,
    forward: &Vector3<f64>,
    measured: Option<&MeasuredMotion>,
    settings: &MatchSettings,
) -> Option<Start> {
    let forward_in_lidar = begin.rotation.inverse() * forward;
    let attempt = |velocity: Velocity| {
        let motion = motion_from_begin(begin, &velocity, first.duration_s);
        let maps = Maps::of_sweep(&first.features, &motion);
        let mid = velocity.advance(&motion.mid, seconds);
        let prediction = Prediction {
            motion: velocity.motion_at(mid, second.duration_s),
            previous: (motion.mid, seconds),
            duration_s: second.duration_s,
            information: measured
                .map_or_else(Matrix6::zeros, |measured| step_information(&measured.covariance, &mid, seconds)),
        };
        let second = match_features(&second.matching, &maps, &prediction, settings)?;
        Some(Start { first: motion, second })
    };
    if let Some(measured) = measured {
        return attempt(measured.velocity);
    }
    let at_way =
        |way_m: &f64| attempt(Velocity { linear: forward_in_lidar * (way_m / seconds), angular: Vector3::zeros() });
    // The first of equals wins, so that standing still is told from nothing else.
    let mut best = WAYS_M.iter().filter_map(at_way).min_by(|a, b| a.second.cost.total_cmp(&b.second.cost))?;
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
