//! Updates with velocities of a GNSS receiver. The first valid course determines north.

use super::{ATTITUDE, N, Navigation, VELOCITY};
use crate::SensorMounting;
use crate::prediction::sensors::{GroundVelocity, SensorLog};
use geometry::{Stamp, UnitQuaternion, Vector3};
use nalgebra::{SMatrix, SVector};

/// Least speed at which a course determines north, m/s.
const NORTH_MPS: f64 = 2.0;
/// Largest angle between the motion of the body and its x axis, rad.
const SLIP: f64 = 0.1;
/// Velocities with a larger squared Mahalanobis distance are rejected: reflections.
const GATE: f64 = 25.0;
/// Consecutive rejections after which the filter is assumed wrong, not the receiver.
const MAX_REJECTED: u32 = 4;
/// Standard deviation of the filter's velocity after such a reset, m/s.
const RESET_MPS: f64 = 3.0;

/// Acceleration over the delay of a measurement that is older than the kept velocities, m/s^2.
const LATE_MPS2: f64 = 3.0;
/// Acceleration of a vehicle without inertial samples, m/s^2: what an error of the stamp then adds to the velocity.
const USUAL_MPS2: f64 = 0.5;

impl Navigation {
    /// Updates the filter at its current time `now` with a measured velocity, which may be older.
    pub(super) fn update_velocity(
        &mut self,
        measured: &GroundVelocity,
        now: Stamp,
        log: &SensorLog,
        mounting: &SensorMounting,
    ) {
        let lever = mounting.antenna_in_body - mounting.imu_in_body;
        let mean = log.mean(measured.stamp.plus_nanos(-20_000_000), measured.stamp.plus_nanos(20_000_000));
        let acceleration =
            mean.map_or(USUAL_MPS2, |mean| (self.rotation * (mean.force - self.force_bias) + self.gravity()).norm());
        let rate = mean.map_or(self.last_rate, |mean| mean.rate - self.rate_bias);
        let by_rotation = self.rotation * rate.cross(&lever);
        if !self.north_is_known {
            if measured.speed() > NORTH_MPS {
                let then =
                    self.level_velocity(measured.stamp).map(|velocity| self.level_from_begin.inverse() * velocity);
                self.find_north(&(then.unwrap_or(self.velocity) + by_rotation), measured);
            } else if measured.speed() > 0.0 {
                return;
            }
        }
        let velocity = self.level_from_begin * (self.velocity + by_rotation);
        let mut h = SMatrix::<f64, 2, N>::zeros();
        let axes = self.level_from_begin.to_rotation_matrix();
        h.fixed_view_mut::<2, 3>(0, VELOCITY).copy_from(&axes.matrix().fixed_rows::<2>(0));
        h.fixed_view_mut::<2, 3>(0, ATTITUDE).copy_from(&-velocity.cross_matrix().fixed_rows::<2>(0));
        // The change of the velocity since a late measurement is known better than the velocity.
        let late_s = now.seconds_since(measured.stamp);
        let then = self.level_velocity(measured.stamp);
        let change = then.map_or_else(Vector3::zeros, |then| self.level_from_begin * self.velocity - then);
        let is_unknown = late_s > 0.0 && then.is_none();
        let sigma = measured.sigma + if is_unknown { LATE_MPS2 * late_s } else { 0.0 };
        let [east, north] = measured.east_north;
        let residual = SVector::<f64, 2>::new(east + change.x - velocity.x, north + change.y - velocity.y);
        let variance = sigma * sigma + (acceleration * measured.late_sigma_s).powi(2);
        let innovation = h * self.covariance * h.transpose() + SMatrix::identity() * variance;
        let is_far = innovation.try_inverse().is_none_or(|inverse| residual.dot(&(inverse * residual)) > GATE);
        if is_far {
            self.n_rejected += 1;
            if self.n_rejected < MAX_REJECTED {
                return;
            }
            for axis in 0..3 {
                self.covariance[(VELOCITY + axis, VELOCITY + axis)] += RESET_MPS * RESET_MPS;
            }
        }
        self.n_rejected = 0;
        self.update(&h, &residual, variance);
        self.last_velocity = Some(measured.stamp);
    }

    /// The velocity at a time before the step, level axes; `None` if it is not kept.
    fn level_velocity(&self, stamp: Stamp) -> Option<Vector3<f64>> {
        let after = self.recent_velocities.partition_point(|recent| recent.stamp < stamp);
        let b = self.recent_velocities.get(after)?;
        if b.stamp == stamp {
            return Some(b.velocity);
        }
        let a = &self.recent_velocities[after.checked_sub(1)?];
        Some(a.velocity.lerp(&b.velocity, stamp.seconds_since(a.stamp) / b.stamp.seconds_since(a.stamp)))
    }

    /// Rotates the level axes so that the body moves in the measured direction. If the velocity of the body is unknown,
    /// it moves along its x axis.
    fn find_north(&mut self, velocity: &Vector3<f64>, measured: &GroundVelocity) {
        let variance = self.covariance.fixed_view::<3, 3>(VELOCITY, VELOCITY).trace();
        let is_known = variance.sqrt() < 0.3 * velocity.norm();
        let direction = if is_known { *velocity } else { self.rotation * Vector3::x() };
        let direction = self.level_from_begin * direction;
        let [east, north] = measured.east_north;
        let angle = north.atan2(east) - direction.y.atan2(direction.x);
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
        let mut transition = SMatrix::<f64, N, N>::identity();
        transition.fixed_view_mut::<3, 3>(ATTITUDE, ATTITUDE).copy_from(rotation.to_rotation_matrix().matrix());
        self.level_from_begin = rotation * self.level_from_begin;
        for recent in &mut self.recent_velocities {
            recent.velocity = rotation * recent.velocity;
        }
        self.covariance = transition * self.covariance * transition.transpose();
        self.cross_covariance *= transition.transpose();
        let heading = if is_known { (variance.sqrt() + measured.sigma) / measured.speed() } else { SLIP };
        self.covariance[(ATTITUDE + 2, ATTITUDE + 2)] += heading * heading;
        self.north_is_known = true;
    }
}
