//! Direction of gravity in submaps from inertial samples.
//!
//! An accelerometer measures the acceleration of the vehicle minus gravity. Over a submap the mean acceleration equals
//! the change of velocity divided by the time; the odometry provides both. The remaining part of the mean points up.

use crate::UpDirection;
use crate::georeferencer::NumberedSubmap;
use crate::recent_path::{HALF_SPAN_NANOS, RecentPath};
use geometry::{Point3, Vector3};
use messages::ImuRow;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Shorter stretches are not used, s: the weight of the velocity error is too large.
const MIN_SECONDS: f64 = 0.8;
/// Longer pauses between samples are gaps, s.
const GAP_SECONDS: f64 = 0.1;
/// The remaining part must have the magnitude of gravity, m/s^2, within this tolerance.
const GRAVITY_MPS2: f64 = 9.81;
const TOLERANCE_MPS2: f64 = 0.5;
/// Standard deviation of 6 mrad: a constant bias of 4 mg, or a velocity error of 12 cm/s over two seconds.
const SIGMA_RAD: f64 = 0.006;

/// Largest number of samples that wait for the odometry: a minute at 1 kHz. Without sweeps there is no odometry.
const MAX_PENDING: usize = 1 << 16;

/// Collects inertial samples.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Gravity {
    /// Samples later than the last pose of the odometry.
    pending: VecDeque<PendingForce>,
    stretch: Option<Stretch>,
}

/// A sample that awaits the odometry of its time.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct PendingForce {
    stamp: i64,
    /// Specific force, m/s^2.
    force_in_body: Vector3<f64>,
}

/// Samples of one submap without gaps.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Stretch {
    submap: usize,
    begin: i64,
    end: i64,
    /// Velocity at the start, m/s, odom axes.
    velocity: Vector3<f64>,
    /// Specific force at the last sample, odom axes, m/s^2.
    force: Vector3<f64>,
    /// Integral of the specific force, m/s.
    integral: Vector3<f64>,
}

impl Gravity {
    pub fn push(&mut self, row: &ImuRow) {
        let force_in_body = Vector3::from(row.acceleration);
        let is_later = self.pending.back().is_none_or(|last| last.stamp < row.stamp);
        if is_later && force_in_body.iter().all(|v| v.is_finite()) {
            self.pending.push_back(PendingForce { stamp: row.stamp, force_in_body });
            let n_over = self.pending.len().saturating_sub(MAX_PENDING);
            self.pending.drain(..n_over);
        }
    }

    /// Uses the samples at times with a velocity from the odometry.
    pub fn update(
        &mut self,
        path: &RecentPath,
        imu_in_body: &Point3<f64>,
        submap_at: impl Fn(i64) -> Option<NumberedSubmap>,
        up_directions: &mut Vec<UpDirection>,
    ) {
        let Some(end) = path.last() else { return };
        let n_ready = self.pending.iter().take_while(|sample| sample.stamp <= end - HALF_SPAN_NANOS).count();
        let ready: Vec<PendingForce> = self.pending.drain(..n_ready).collect();
        for PendingForce { stamp, force_in_body } in ready {
            let Some(pose) = path.at(stamp) else { continue };
            let Some(NumberedSubmap { number: submap, .. }) = submap_at(stamp) else { continue };
            let force = pose.rotation * force_in_body;
            let continues = |s: &Stretch| s.submap == submap && ((stamp - s.end) as f64) < GAP_SECONDS * 1e9;
            if self.stretch.as_ref().is_none_or(|stretch| !continues(stretch)) {
                self.close(path, imu_in_body, &submap_at, up_directions);
                let Some(velocity) = path.velocity(stamp, imu_in_body) else { continue };
                let begin = stamp;
                let end = stamp;
                let integral = Vector3::zeros();
                self.stretch = Some(Stretch { submap, begin, end, velocity, force, integral });
                continue;
            }
            if let Some(stretch) = &mut self.stretch {
                stretch.integral += (stretch.force + force) * (0.5e-9 * (stamp - stretch.end) as f64);
                stretch.end = stamp;
                stretch.force = force;
            }
        }
    }

    /// Ends the open stretch.
    pub fn close(
        &mut self,
        path: &RecentPath,
        imu_in_body: &Point3<f64>,
        submap_at: impl Fn(i64) -> Option<NumberedSubmap>,
        up_directions: &mut Vec<UpDirection>,
    ) {
        let Some(stretch) = self.stretch.take() else { return };
        let seconds = (stretch.end - stretch.begin) as f64 * 1e-9;
        let Some(velocity) = path.velocity(stretch.end, imu_in_body) else { return };
        let Some(NumberedSubmap { odom_from_submap, .. }) = submap_at(stretch.begin) else { return };
        if seconds < MIN_SECONDS {
            return;
        }
        let up = (stretch.integral - (velocity - stretch.velocity)) / seconds;
        if (up.norm() - GRAVITY_MPS2).abs() < TOLERANCE_MPS2 {
            let up_in_submap = odom_from_submap.rotation.inverse() * up.normalize();
            up_directions.push(UpDirection { submap: stretch.submap, up_in_submap, sigma_rad: SIGMA_RAD });
        }
    }
}
