//! From inertial samples to the direction of gravity in submaps.
//!
//! What an accelerometer feels is the vehicle's acceleration less gravity. Over the time of a submap the mean acceleration is
//! the change of velocity, which the odometry knows; what is left of the mean points up.

use crate::recent_path::{HALF_SPAN_NANOS, RecentPath};
use geometry::{Point3, Pose, Vector3};
use messages::ImuRow;
use pose_graph::Upright;
use serde::{Deserialize, Serialize};

/// Shorter stretches are not used, s: the velocity's error weighs too much.
const LEAST_SECONDS: f64 = 0.8;
/// Pauses between samples beyond this are gaps, s.
const GAP_SECONDS: f64 = 0.1;
/// What is left must be as long as gravity, m/s^2, within this.
const GRAVITY_MPS2: f64 = 9.81;
const TOLERANCE_MPS2: f64 = 0.5;
/// 6 mrad: a bias of 4 mg, which lasts, or a velocity that is wrong by 12 cm/s over two seconds.
const SIGMA_RAD: f64 = 0.006;

/// Collects samples; part of the stage's state.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Gravity {
    waiting: Vec<(i64, Vector3<f64>)>,
    stretch: Option<Stretch>,
}

/// Samples of one submap without gaps.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Stretch {
    submap: usize,
    begin: i64,
    end: i64,
    /// m/s, odom axes.
    velocity: Vector3<f64>,
    /// Force at the last sample, odom axes, m/s^2.
    force: Vector3<f64>,
    /// Integral of the force, m/s.
    sum: Vector3<f64>,
}

impl Gravity {
    pub fn push(&mut self, row: &ImuRow) {
        let force = Vector3::from(row.acceleration);
        let is_later = self.waiting.last().is_none_or(|(last, _)| *last < row.stamp);
        if is_later && force.iter().all(|v| v.is_finite()) {
            self.waiting.push((row.stamp, force));
        }
    }

    /// Takes the samples around which the odometry knows the velocity.
    pub fn settle(
        &mut self,
        path: &RecentPath,
        sensor_in_body: &Point3<f64>,
        submap_at: impl Fn(i64) -> Option<(usize, Pose)>,
        uprights: &mut Vec<Upright>,
    ) {
        let Some(end) = path.last() else { return };
        let n_passed = self.waiting.iter().take_while(|(stamp, _)| *stamp <= end - HALF_SPAN_NANOS).count();
        let passed: Vec<(i64, Vector3<f64>)> = self.waiting.drain(..n_passed).collect();
        for (stamp, force_in_body) in passed {
            let (Some(pose), Some((submap, _))) = (path.at(stamp), submap_at(stamp)) else { continue };
            let force = pose.rotation * force_in_body;
            let follows = |s: &Stretch| s.submap == submap && ((stamp - s.end) as f64) < GAP_SECONDS * 1e9;
            if self.stretch.as_ref().is_none_or(|stretch| !follows(stretch)) {
                self.close(path, sensor_in_body, &submap_at, uprights);
                let Some(velocity) = path.velocity(stamp, sensor_in_body) else { continue };
                let (begin, end, sum) = (stamp, stamp, Vector3::zeros());
                self.stretch = Some(Stretch { submap, begin, end, velocity, force, sum });
                continue;
            }
            if let Some(stretch) = &mut self.stretch {
                stretch.sum += (stretch.force + force) * (0.5e-9 * (stamp - stretch.end) as f64);
                (stretch.end, stretch.force) = (stamp, force);
            }
        }
    }

    /// Ends the stretch that is open.
    pub fn close(
        &mut self,
        path: &RecentPath,
        sensor_in_body: &Point3<f64>,
        submap_at: impl Fn(i64) -> Option<(usize, Pose)>,
        uprights: &mut Vec<Upright>,
    ) {
        let Some(stretch) = self.stretch.take() else { return };
        let seconds = (stretch.end - stretch.begin) as f64 * 1e-9;
        let (Some(velocity), Some((_, odom_from_submap))) =
            (path.velocity(stretch.end, sensor_in_body), submap_at(stretch.begin))
        else {
            return;
        };
        if seconds < LEAST_SECONDS {
            return;
        }
        let up = (stretch.sum - (velocity - stretch.velocity)) / seconds;
        if (up.norm() - GRAVITY_MPS2).abs() < TOLERANCE_MPS2 {
            let up_in_submap = odom_from_submap.rotation.inverse() * up.normalize();
            uprights.push(Upright { submap: stretch.submap, up_in_submap, sigma_rad: SIGMA_RAD });
        }
    }
}
