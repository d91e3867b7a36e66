//! Georeferences the odometry with the fixes of a GNSS receiver.
//!
//! 1. The delay of the receiver's stamps, and north, from the receiver's velocities.
//! 2. The shape of the drive from odometry, loops, gravity and velocities.
//! 3. The placement of that shape that agrees with the most fixes.
//! 4. All measurements together, starting from that placement; between the solutions the errors of the fixes are
//!    estimated from their residuals, without the fixes that disagree while most agree.

use crate::deviations::{judge, majority};
use crate::fix_shape::shape_doubt;
use crate::fixes::UsedFix;
use crate::receiver_clock::{ReceiverDelay, receiver_delay, yaw_by_velocities};
use crate::receiver_errors::correct_positions;
use crate::{AntennaPosition, Gauge, PointPair, PoseGraph, Solution, Start, UpDirection, align_odometry};
use doubts::Doubt;
use geometry::{Geodetic, Isometry3, Pose, UnitQuaternion, Vector3};

/// Least root mean square distance of positions from their center with which they determine north, m: for example on 35
/// m of straight road. An error of one metre then rotates the result by some degrees, and the covariances include it.
pub(crate) const MIN_SPREAD_M: f64 = 10.0;
/// Rounds in which errors of fixes and poses of submaps are estimated alternately; further rounds move submaps by
/// millimetres.
const ROUNDS: usize = 4;

/// Prior without gravity measurements: roads slope by less than a tenth, most by far less. Otherwise velocities and
/// wrong heights would tilt the drive.
const START_IS_LEVEL: UpDirection =
    UpDirection { submap: 0, up_in_submap: Vector3::new(0.0, 0.0, 1.0), sigma_rad: 0.03 };

/// Weight factor of a fix that disagrees with the majority.
const RELEASED_SHARE: f64 = 1e-3;

pub(crate) struct Placing {
    /// Root mean square horizontal distance of the fixes from their center, m.
    pub spread_m: f64,
    pub delay: Option<ReceiverDelay>,
    /// The doubt about the size and shape of the path of the fixes.
    pub shape: Option<Doubt>,
    /// The solution; `None` if the fixes do not determine the placement.
    pub placed: Option<Solution>,
}

/// Georeferences the drive. `graph` has the measurements other than fixes.
pub(crate) fn place_by_fixes(
    graph: &PoseGraph,
    odom_from_submap: &[Pose],
    fixes: &[UsedFix],
    origin: Option<&Geodetic>,
    unsmooth_fixes: bool,
) -> Placing {
    let delay = receiver_delay(fixes);
    let late_s = delay.as_ref().filter(|delay| !delay.is_out_of_range()).map_or(0.0, |delay| delay.late_s);
    let mut graph = graph.clone();
    if graph.up_directions.is_empty() {
        graph.up_directions.push(START_IS_LEVEL);
    }
    let of_submap = |fix: &UsedFix| odom_from_submap[fix.submap];
    graph.velocities = fixes.iter().filter_map(|fix| fix.horizontal_velocity(late_s, &of_submap(fix))).collect();
    let positions: Vec<AntennaPosition> = fixes.iter().map(|fix| fix.position(late_s, &of_submap(fix))).collect();
    let Some(FixedStart { spread_m, pairs, world_from_submap }) =
        start(&graph, &positions, odom_from_submap, yaw_by_velocities(fixes, late_s))
    else {
        return Placing { spread_m: 0.0, delay, shape: None, placed: None };
    };
    let shape = shape_doubt(&pairs, origin);
    let is_spread = spread_m >= MIN_SPREAD_M;
    let placed = is_spread.then(|| solve(graph, &positions, world_from_submap, fixes, unsmooth_fixes)).flatten();
    Placing { spread_m, delay, shape, placed }
}

/// Poses that agree with the most fixes.
struct FixedStart {
    /// Spread of the fixes.
    spread_m: f64,
    /// Positions of the antenna by the odometry and by the fixes.
    pairs: Vec<PointPair>,
    world_from_submap: Vec<Pose>,
}

/// `yaw`: rotation from odom to the world, from the velocities.
fn start(
    graph: &PoseGraph,
    positions: &[AntennaPosition],
    odom_from_submap: &[Pose],
    yaw: Option<f64>,
) -> Option<FixedStart> {
    let about_z =
        |yaw| Isometry3::from_parts(Vector3::zeros().into(), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw));
    let turned: Vec<Pose> = odom_from_submap.iter().map(|pose| about_z(yaw.unwrap_or(0.0)) * pose).collect();
    let gauge = if yaw.is_some() { Gauge::FirstPosition } else { Gauge::FirstPositionAndHeading };
    let shape = graph.solve(&turned, gauge).map_or(turned, |solution| solution.poses);
    let pair = |position: &AntennaPosition| PointPair {
        p_in_odom: shape[position.submap] * position.p_in_submap,
        p_in_world: position.p_in_world,
        weight: position.share,
    };
    let pairs: Vec<PointPair> = positions.iter().map(pair).collect();
    let alignment = align_odometry(&pairs, yaw.map(|_| 0.0))?;
    let world_from_submap = shape.iter().map(|pose| alignment.world_from_odom * pose).collect();
    Some(FixedStart { spread_m: alignment.spread_m, pairs, world_from_submap })
}

/// Solves the graph with the fixes; `None` if no fix agrees with the result.
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
        graph.positions = corrected(fixes, positions, &poses, unsmooth_fixes);
        let solution = graph.solve_from(&poses, Start::Aligned, Gauge::Positions)?;
        poses.clone_from(&solution.poses);
        last = Some(solution);
    }
    let mut solution = last?;
    judge(&mut solution, fixes, &graph.positions);
    (Solution::n_inliers(&solution.position_weights) > 0).then_some(solution)
}

/// Corrects the fixes that agree with these poses. The other fixes, if they are the minority, get a negligible weight.
fn corrected(
    fixes: &[UsedFix],
    positions: &[AntennaPosition],
    poses: &[Pose],
    unsmooth_fixes: bool,
) -> Vec<AntennaPosition> {
    let kept = majority(fixes, positions, poses);
    let used: Vec<&UsedFix> = kept.iter().map(|number| &fixes[*number]).collect();
    let mut agreeing: Vec<AntennaPosition> = kept.iter().map(|number| positions[*number]).collect();
    correct_positions(&used, &mut agreeing, poses, unsmooth_fixes);
    let released = |position: &AntennaPosition| AntennaPosition { share: position.share * RELEASED_SHARE, ..*position };
    let mut corrected: Vec<AntennaPosition> = positions.iter().map(released).collect();
    for (number, position) in kept.into_iter().zip(agreeing) {
        corrected[number] = position;
    }
    corrected
}
