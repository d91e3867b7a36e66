//! Initial motion over the first two sweeps, at an unknown speed.
//!
//! A match that assumes rest can converge to a wrong wall when the vehicle moves at 10 m/s. Therefore several speeds
//! along the vehicle's forward axis are tried. Each speed deskews *both* sweeps; the speed with the lowest cost is
//! used.

use super::distant::{is_distant, settings_at};
use super::top_view::{SearchExtent, poses_by_top_view};
use super::upright_cost::upright_cost;
use crate::features::sweep_features::SweepFeatures;
use crate::map::maps::Maps;
use crate::matching::{MatchSettings, Matched, Prediction, match_features};
use crate::motion::Velocity;
use crate::prediction::sensors::SensorLog;
use crate::self_calibration::ground_tilt::GroundTilt;
use crate::self_calibration::ring_errors::RingError;
use crate::self_calibration::spin_direction::{TurnLever, TurnShare};
use crate::{SensorMounting, SweepMotion};
use geometry::{Isometry3, Pose, Stamp, Translation3, UnitQuaternion, Vector3};
use nalgebra::Matrix6;

/// Tried displacements between two sweeps, m: steps of 0.4 m, inside the search radius of a match. 3.2 m in 0.1 s are
/// 32 m/s; backwards the limit is 8 m/s.
const DISPLACEMENTS_M: [f64; 11] = [0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2, -0.4, -0.8];
/// A speed other than zero must lower the cost by this factor. In a tunnel all speeds fit equally well; a car at 8 m/s
/// between houses (KITTI raw 0048) fits 15 % better at its true speed.
const STANDSTILL_FACTOR: f64 = 0.9;
/// Limits of the search between distant sweeps: highway speed, the range of the compared surfaces, and the turn of a car in a second.
const MAX_SPEED_MPS: f64 = 35.0;
const MAX_SHIFT_M: f64 = 20.0;
const MAX_TURN_RAD: f64 = 0.9;
/// Matched candidates of that search.
const N_CANDIDATES: usize = 6;
/// Rounds that rebuild the first sweep with the estimated speed. Each reduces the error by a factor of ten or more.
const REFINEMENTS: usize = 3;
/// Validity time of a GNSS velocity, s.
const VELOCITY_VALID_S: f64 = 0.5;

/// The motion over the first two sweeps.
pub(crate) struct InitialMatch {
    /// Motion over the first sweep.
    pub first: SweepMotion,
    /// The second sweep matched to the first.
    pub second: Matched,
}

/// The motion between the first two sweeps as measured by other sensors.
pub(crate) struct InitialMotion {
    /// Angular rate in the LiDAR's axes, rad/s; zero if it is unknown.
    pub angular: Vector3<f64>,
    /// Speed over ground, m/s.
    pub speed: Option<f64>,
}

impl InitialMotion {
    pub fn from_log(log: &SensorLog, [begin, end]: [Stamp; 2], mounting: &SensorMounting) -> Self {
        let inertial = log.mean(begin, end).filter(|_| log.covers(begin, end));
        let lidar_from_body = mounting.body_from_lidar.rotation.inverse();
        let angular = inertial.map_or_else(Vector3::zeros, |mean| lidar_from_body * mean.rate);
        let velocity = log.velocity_at(end).filter(|velocity| end.seconds_since(velocity.stamp) < VELOCITY_VALID_S);
        Self { angular, speed: velocity.map(crate::GroundVelocity::speed) }
    }
}

/// Finds the motion over two sweeps whose middles are `seconds` apart: at the measured speed, or at the speed along
/// odom's x axis with the lowest cost. The first sweep starts at the pose `begin`. `None` if no speed gives a match.
pub(crate) fn initialize(
    first: &SweepFeatures,
    second: &SweepFeatures,
    seconds: f64,
    begin: &Pose,
    initial: &InitialMotion,
    settings: &MatchSettings,
) -> Option<InitialMatch> {
    let settings = settings_at(settings, seconds);
    let settings = &*settings;
    let forward_in_lidar = begin.rotation.inverse() * Vector3::x();
    let attempt = |velocity: Velocity| {
        let motion = motion_from_begin(begin, &velocity, first.duration_s);
        let maps = Maps::from_sweep(&first.features, &motion);
        let mid = velocity.advance(&motion.mid, seconds);
        let prediction = Prediction {
            motion: velocity.motion_at(mid, second.duration_s),
            previous: motion.mid,
            seconds,
            duration_s: second.duration_s,
            information: Matrix6::zeros(),
            ground_tilt: GroundTilt::default(),
            elevation: RingError::NONE,
            turn: TurnShare::default(),
            turn_lever: TurnLever::NONE,
        };
        let second = match_features(&second.matching, &maps, &prediction, settings)?.matched;
        Some(InitialMatch { first: motion, second })
    };
    let at_speed = |speed: f64| attempt(Velocity { linear: forward_in_lidar * speed, angular: initial.angular });
    let search = || {
        let starts = DISPLACEMENTS_M
            .iter()
            .filter_map(|displacement_m| Some((*displacement_m, at_speed(displacement_m / seconds)?)));
        // Where geometry is degenerate, noise must not decide between equal costs.
        let rest = |displacement_m: f64| if displacement_m == 0.0 { STANDSTILL_FACTOR } else { 1.0 };
        if !is_distant(seconds) {
            let cost = |(displacement_m, start): &(f64, InitialMatch)| start.second.cost * rest(*displacement_m);
            return starts.min_by(|a, b| cost(a).total_cmp(&cost(b))).map(|(_, start)| start);
        }
        let far = far_poses(first, second, begin, seconds).into_iter().filter_map(|mid| {
            let start = attempt(Velocity::between(begin, &mid, seconds))?;
            let again = attempt(Velocity::between(&start.first.mid, &start.second.motion.mid, seconds))?;
            Some((f64::INFINITY, again))
        });
        let cost = |(displacement_m, start): &(f64, InitialMatch)| {
            let maps = Maps::from_sweep(&first.features, &start.first);
            upright_cost(&second.matching, &maps, &start.second.motion, settings) * rest(*displacement_m)
        };
        let costs = starts.chain(far).map(|start| (cost(&start), start.1));
        costs.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, start)| start)
    };
    let mut best = initial.speed.and_then(at_speed).or_else(search)?;
    for _ in 0..REFINEMENTS {
        let velocity = Velocity::between(&best.first.mid, &best.second.motion.mid, seconds);
        best = attempt(velocity)?;
    }
    Some(best)
}

/// Poses of the second sweep, beyond the radius of a match, at which its upright surfaces lie on the same ones of the first.
fn far_poses(first: &SweepFeatures, second: &SweepFeatures, begin: &Pose, seconds: f64) -> Vec<Pose> {
    let still = SweepMotion::still(*begin);
    let maps = Maps::from_sweep(&first.features, &still);
    let extent = SearchExtent { turn_rad: MAX_TURN_RAD, shift_m: (MAX_SPEED_MPS * seconds).min(MAX_SHIFT_M) };
    poses_by_top_view(&second.features, maps.points(), &still, &extent, N_CANDIDATES)
}

/// The motion at constant velocity that starts at `begin`.
fn motion_from_begin(begin: &Pose, velocity: &Velocity, duration_s: f64) -> SweepMotion {
    let rotation = velocity.angular * duration_s;
    let mid_rotation = begin.rotation * UnitQuaternion::from_scaled_axis(rotation * 0.5);
    let translation = mid_rotation * velocity.linear * duration_s;
    let mid_position = begin.translation.vector + translation * 0.5;
    SweepMotion { mid: Isometry3::from_parts(Translation3::from(mid_position), mid_rotation), translation, rotation }
}
