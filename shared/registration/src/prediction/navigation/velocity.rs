//! Updates with velocities of a GNSS receiver. The first valid course determines north.

use super::{ATTITUDE, N, Navigation, VELOCITY};
use crate::SensorMounting;
use crate::prediction::sensors::{GroundVelocity, SensorLog};
use geometry::{UnitQuaternion, Vector3};
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

impl Navigation {
    /// Updates the filter at its current time with a measured velocity.
    pub(super) fn update_velocity(&mut self, measured: &GroundVelocity, log: &SensorLog, mounting: &SensorMounting) {
        let lever = mounting.antenna_in_body - mounting.imu_in_body;
        let rate = log.mean(measured.stamp.plus_nanos(-20_000_000), measured.stamp.plus_nanos(20_000_000));
        let rate = rate.map_or(self.last_rate, |mean| mean.rate - self.rate_bias);
        let by_rotation = self.rotation * rate.cross(&lever);
        let [east, north] = measured.east_north;
        if !self.north_is_known {
            if measured.speed() > NORTH_MPS {
                self.find_north(&(self.velocity + by_rotation), measured);
            } else if measured.speed() > 0.0 {
                return;
            }
        }
        let velocity = self.level_from_begin * (self.velocity + by_rotation);
        let mut h = SMatrix::<f64, 2, N>::zeros();
        let axes = self.level_from_begin.to_rotation_matrix();
        h.fixed_view_mut::<2, 3>(0, VELOCITY).copy_from(&axes.matrix().fixed_rows::<2>(0));
        h.fixed_view_mut::<2, 3>(0, ATTITUDE).copy_from(&-velocity.cross_matrix().fixed_rows::<2>(0));
        let residual = SVector::<f64, 2>::new(east - velocity.x, north - velocity.y);
        let variance = measured.sigma * measured.sigma;
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
        self.covariance = transition * self.covariance * transition.transpose();
        self.cross_covariance *= transition.transpose();
        let heading = if is_known { (variance.sqrt() + measured.sigma) / measured.speed() } else { SLIP };
        self.covariance[(ATTITUDE + 2, ATTITUDE + 2)] += heading * heading;
        self.north_is_known = true;
    }
}
