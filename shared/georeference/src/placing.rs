//! Places the odometry on the Earth by the fixes of a GNSS receiver.
//!
//! 1. The delay of the receiver's stamps, and north, by the receiver's velocities.
//! 2. The shape of the drive by odometry, loops, gravity and velocities.
//! 3. The place of that shape that agrees with the most fixes.
//! 4. All measurements together from there; the errors of the fixes are estimated from their residuals in between. Last without
//!    the fixes that disagree, if most agree.

use crate::deviations::{judge, release_disagreeing};
use crate::fixes::UsedFix;
use crate::receiver_clock::{ReceiverDelay, receiver_delay, yaw_by_velocities};
use crate::receiver_errors::correct_positions;
use crate::{AntennaPosition, Gauge, PointPair, PoseGraph, Solution, Start, align_odometry};
use geometry::{Isometry3, Pose, UnitQuaternion, Vector3};

/// Positions determine north if their root mean square distance from their center is at least this, m: as on 35 m of straight
/// road. An error of one metre then rotates the result by some degrees, and the covariances say so.
pub(crate) const MIN_SPREAD_M: f64 = 10.0;
/// Rounds in which errors of fixes and poses of submaps are estimated in turn; further rounds move submaps by millimeters.
const ROUNDS: usize = 4;

pub(crate) struct Placing {
    /// Root mean square distance of the fixes from their center, horizontally, m.
    pub spread_m: f64,
    pub delay: Option<ReceiverDelay>,
    /// `None` if the fixes do not determine the place.
    pub placed: Option<Solution>,
}

/// `graph` has the measurements beside the fixes.
pub(crate) fn place_by_fixes(
    graph: &PoseGraph,
    odom_from_submap: &[Pose],
    fixes: &[UsedFix],
    unsmooth_fixes: bool,
) -> Placing {
    let delay = receiver_delay(fixes);
    let late_s = delay.as_ref().filter(|delay| !delay.is_out_of_range()).map_or(0.0, |delay| delay.late_s);
    let mut graph = graph.clone();
    let of_submap = |fix: &UsedFix| odom_from_submap[fix.submap];
    graph.velocities = fixes.iter().filter_map(|fix| fix.horizontal_velocity(late_s, &of_submap(fix))).collect();
    let positions: Vec<AntennaPosition> = fixes.iter().map(|fix| fix.position(late_s, &of_submap(fix))).collect();
    let Some((spread_m, start)) = start(&graph, &positions, odom_from_submap, yaw_by_velocities(fixes, late_s)) else {
        return Placing { spread_m: 0.0, delay, placed: None };
    };
    let is_spread = spread_m >= MIN_SPREAD_M;
    let placed = is_spread.then(|| solve(graph, &positions, start, fixes, unsmooth_fixes)).flatten();
    Placing { spread_m, delay, placed }
}

/// Spread of the fixes, and `world_from_submap` by the most fixes. `yaw`: world from odom, by the velocities.
fn start(
    graph: &PoseGraph,
    positions: &[AntennaPosition],
    odom_from_submap: &[Pose],
    yaw: Option<f64>,
) -> Option<(f64, Vec<Pose>)> {
    let about_z =
        |yaw| Isometry3::from_parts(Vector3::zeros().into(), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw));
    let turned: Vec<Pose> = odom_from_submap.iter().map(|pose| about_z(yaw.unwrap_or(0.0)) * pose).collect();
    let gauge = match (yaw.is_some(), graph.up_directions.is_empty()) {
        (true, _) => Gauge::FirstPosition,
        (false, false) => Gauge::FirstPositionAndHeading,
        (false, true) => Gauge::FirstPose,
    };
    let shape = graph.solve(&turned, gauge).map_or(turned, |solution| solution.poses);
    let pair = |position: &AntennaPosition| PointPair {
        p_in_odom: shape[position.submap] * position.p_in_submap,
        p_in_world: position.p_in_world,
        weight: position.share,
    };
    let pairs: Vec<PointPair> = positions.iter().map(pair).collect();
    let alignment = align_odometry(&pairs, yaw.map(|_| 0.0))?;
    let start = shape.iter().map(|pose| alignment.world_from_odom * pose).collect();
    Some((alignment.spread_m, start))
}

/// `None` if no fix agrees with the result.
fn solve(
    mut graph: PoseGraph,
    positions: &[AntennaPosition],
    start: Vec<Pose>,
    fixes: &[UsedFix],
    unsmooth_fixes: bool,
) -> Option<Solution> {
    let mut poses = start;
    let mut last = None;
    for _ in 0..ROUNDS {
        graph.positions = positions.to_vec();
        correct_positions(fixes, &mut graph.positions, &poses, unsmooth_fixes);
        let solution = graph.solve_from(&poses, Start::Aligned, Gauge::Positions)?;
        poses.clone_from(&solution.poses);
        last = Some(solution);
    }
    let mut solution = last?;
    if release_disagreeing(fixes, &mut graph.positions, &poses) {
        solution = graph.solve_from(&poses, Start::Aligned, Gauge::Positions)?;
    }
    judge(&mut solution, fixes, &graph.positions);
    (Solution::n_inliers(&solution.position_weights) > 0).then_some(solution)
}
