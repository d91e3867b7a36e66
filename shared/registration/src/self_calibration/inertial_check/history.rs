//! The last seconds of samples and poses, and the pairs of vectors that compare them.

use crate::InertialSample;
use geometry::{Point3, Pose, Stamp, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Time for which samples are kept, ns, and their largest number.
const KEPT_NANOS: i64 = 3_000_000_000;
const MAX_SAMPLES: usize = 8_192;
/// Longer pauses between samples are gaps, ns.
const GAP_NANOS: i64 = 60_000_000;
/// Half of the time span of an acceleration, s. An acceleration is the change between the mean velocities before and
/// after: a position error of 1 cm then becomes 0.1 m/s^2.
const HALF_SPAN_S: f64 = 0.5;
/// Poses farther apart in time are not compared, s.
const MAX_STEP_S: f64 = 0.25;
/// Largest number of poses: two spans at 20 Hz.
const MAX_POSES: usize = 48;

/// A sample and the integral of the rates up to it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Knot {
    stamp: i64,
    force: Vector3<f64>,
    rate: Vector3<f64>,
    angle: Vector3<f64>,
}

/// Pose of the body at a time.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct TimedPose {
    stamp: i64,
    pose: Pose,
}

/// Recent samples and poses.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct History {
    knots: VecDeque<Knot>,
    /// Consecutively measured poses.
    poses: VecDeque<TimedPose>,
    /// Stamp up to which rotations have been compared.
    rotations_until: i64,
    /// Stamp up to which accelerations have been compared.
    accelerations_until: i64,
}

impl History {
    pub fn push_sample(&mut self, sample: &InertialSample) {
        let InertialSample { stamp, force, rate } = *sample;
        let angle = match self.knots.back() {
            Some(last) if last.stamp >= stamp.0 => return,
            Some(last) => last.angle + (last.rate + rate) * (0.5e-9 * (stamp.0 - last.stamp) as f64),
            None => Vector3::zeros(),
        };
        self.knots.push_back(Knot { stamp: stamp.0, force, rate, angle });
        let is_old = |knot: &Knot| knot.stamp < stamp.0 - KEPT_NANOS;
        while self.knots.len() > MAX_SAMPLES || self.knots.front().is_some_and(is_old) {
            self.knots.pop_front();
        }
    }

    /// Returns the angular rate of the body since the previous pose.
    pub fn push_pose(&mut self, stamp: Stamp, odom_from_body: Option<&Pose>) -> Option<Vector3<f64>> {
        let Some(pose) = odom_from_body else {
            self.poses.clear();
            return None;
        };
        let is_next = |last: &TimedPose| {
            let step_s = seconds(last.stamp, stamp.0);
            step_s > 0.0 && step_s < MAX_STEP_S
        };
        if !self.poses.back().is_some_and(is_next) {
            self.poses.clear();
        }
        let next = TimedPose { stamp: stamp.0, pose: *pose };
        let rate = self.poses.back().map(|last| angular_rate(last, &next));
        self.poses.push_back(next);
        if self.poses.len() > MAX_POSES {
            self.poses.pop_front();
        }
        rate
    }

    /// Calls `use_pair` for all pairs of poses with samples up to `max_lag_s` before and after. The arguments are the
    /// mean angular rate of the body between the poses, and a function that returns the mean rate of the unit at a time
    /// offset (s).
    pub fn take_rotations(
        &mut self,
        max_lag_s: f64,
        mut use_pair: impl FnMut(&Vector3<f64>, &dyn Fn(f64) -> Vector3<f64>),
    ) {
        let lag = (max_lag_s * 1e9) as i64;
        let mut until = self.rotations_until;
        let Some(last) = self.knots.back() else { return };
        for (a, b) in self.poses.iter().zip(self.poses.iter().skip(1)) {
            if b.stamp <= until || b.stamp + lag > last.stamp {
                continue;
            }
            until = b.stamp;
            if self.covers(a.stamp - lag, b.stamp + lag) {
                let mean_at = |late_s: f64| {
                    let late = (late_s * 1e9) as i64;
                    (self.angle_at(b.stamp + late) - self.angle_at(a.stamp + late)) / seconds(a.stamp, b.stamp)
                };
                use_pair(&angular_rate(a, b), &mean_at);
            }
        }
        self.rotations_until = until;
    }

    /// Calls `use_pair` with the specific forces of body and unit, each the mean over [`HALF_SPAN_S`] around a pose, and with
    /// the rotation of the pose.
    pub fn take_accelerations(
        &mut self,
        imu_in_body: &Point3<f64>,
        gravity_mps2: f64,
        mut use_pair: impl FnMut(&Vector3<f64>, &Vector3<f64>, &UnitQuaternion<f64>),
    ) {
        let mut until = self.accelerations_until;
        let Some(last) = self.knots.back().map(|knot| knot.stamp) else { return };
        for middle in &self.poses {
            if middle.stamp <= until {
                continue;
            }
            let begin = self.poses.iter().rfind(|other| seconds(other.stamp, middle.stamp) >= HALF_SPAN_S);
            let end = self.poses.iter().find(|other| seconds(middle.stamp, other.stamp) >= HALF_SPAN_S);
            let Some(begin) = begin else { continue };
            let Some(end) = end else { continue };
            if end.stamp > last {
                continue;
            }
            until = middle.stamp;
            if !self.covers(begin.stamp, end.stamp) {
                continue;
            }
            let velocity = |from: &TimedPose, to: &TimedPose| {
                ((to.pose * imu_in_body).coords - (from.pose * imu_in_body).coords) / seconds(from.stamp, to.stamp)
            };
            let change = velocity(middle, end) - velocity(begin, middle);
            let acceleration = change / (0.5 * seconds(begin.stamp, end.stamp));
            let force = middle.pose.rotation.inverse() * (acceleration + Vector3::z() * gravity_mps2);
            use_pair(&force, &self.mean_force(begin.stamp, middle.stamp, end.stamp), &middle.pose.rotation);
        }
        self.accelerations_until = until;
    }

    /// Mean force with weights that rise to the middle and fall to the end, as in the change between two mean
    /// velocities.
    fn mean_force(&self, begin: i64, middle: i64, end: i64) -> Vector3<f64> {
        let first = self.knots.partition_point(|knot| knot.stamp < begin);
        let weight = |stamp: i64| {
            if stamp < middle {
                seconds(begin, stamp) / seconds(begin, middle)
            } else {
                seconds(stamp, end) / seconds(middle, end)
            }
        };
        let within = self.knots.iter().skip(first).take_while(|knot| knot.stamp <= end);
        let (sum, total) = within.fold((Vector3::zeros(), 0.0), |(sum, total), knot| {
            let weight = weight(knot.stamp);
            (sum + knot.force * weight, total + weight)
        });
        if total > 0.0 { sum / total } else { sum }
    }

    /// Integral of the rates up to a stamp within the samples.
    fn angle_at(&self, stamp: i64) -> Vector3<f64> {
        let after = self.knots.partition_point(|knot| knot.stamp < stamp);
        let (Some(b), Some(a)) = (self.knots.get(after), after.checked_sub(1).and_then(|i| self.knots.get(i))) else {
            return Vector3::zeros();
        };
        let share = seconds(a.stamp, stamp) / seconds(a.stamp, b.stamp);
        a.angle + (b.angle - a.angle) * share
    }

    /// Whether there are samples without gaps around this time.
    fn covers(&self, begin: i64, end: i64) -> bool {
        let Some(first) = self.knots.partition_point(|knot| knot.stamp < begin).checked_sub(1) else { return false };
        let until = self.knots.partition_point(|knot| knot.stamp < end);
        let pairs = self.knots.iter().zip(self.knots.iter().skip(1)).skip(first).take(until - first);
        until < self.knots.len() && pairs.into_iter().all(|(a, b)| b.stamp - a.stamp <= GAP_NANOS)
    }
}

/// Seconds from the first time to the second.
fn seconds(from: i64, to: i64) -> f64 {
    (to - from) as f64 * 1e-9
}

fn angular_rate(from: &TimedPose, to: &TimedPose) -> Vector3<f64> {
    (from.pose.rotation.inverse() * to.pose.rotation).scaled_axis() / seconds(from.stamp, to.stamp)
}
