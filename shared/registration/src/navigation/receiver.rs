//! Velocities of a receiver, and by the first of them where north is.

use super::{ATTITUDE, N, Navigation, VELOCITY};
use crate::SensorPlaces;
use crate::sensors::{GroundVelocity, SensorLog};
use geometry::{UnitQuaternion, Vector3};
use nalgebra::{SMatrix, SVector};

/// A course says where north is from this speed on, m/s.
const NORTH_MPS: f64 = 2.0;
/// A body may move aslant of its x axis by this, rad.
const SLIP: f64 = 0.1;
/// Velocities this many (squared) deviations off are refused: reflections. So many in a row are believed more than the rest.
const GATE: f64 = 25.0;
const INSISTENT: u32 = 4;
/// How far the filter may be wrong then, m/s.
const INSISTED_MPS: f64 = 3.0;
impl Navigation {
    /// A receiver's velocity, now.
    pub(super) fn hear(&mut self, told: &GroundVelocity, log: &SensorLog, places: &SensorPlaces) {
        let lever = places.antenna_in_body - places.imu_in_body;
        let rate = log.mean(told.stamp.plus_nanos(-20_000_000), told.stamp.plus_nanos(20_000_000));
        let rate = rate.map_or(self.last_rate, |(_, rate)| rate - self.rate_bias);
        let swing = self.turn * rate.cross(&lever);
        let [east, north] = told.east_north;
        if !self.north_is_known {
            if told.speed() > NORTH_MPS {
                self.find_north(&(self.velocity + swing), told);
            } else if told.speed() > 0.0 {
                return;
            }
        }
        let velocity = self.level_from_begin * (self.velocity + swing);
        let mut h = SMatrix::<f64, 2, N>::zeros();
        let axes = self.level_from_begin.to_rotation_matrix();
        h.fixed_view_mut::<2, 3>(0, VELOCITY).copy_from(&axes.matrix().fixed_rows::<2>(0));
        h.fixed_view_mut::<2, 3>(0, ATTITUDE).copy_from(&-velocity.cross_matrix().fixed_rows::<2>(0));
        let residual = SVector::<f64, 2>::new(east - velocity.x, north - velocity.y);
        let variance = told.sigma * told.sigma;
        let spread = h * self.covariance * h.transpose() + SMatrix::identity() * variance;
        let is_far = spread.try_inverse().is_none_or(|inverse| residual.dot(&(inverse * residual)) > GATE);
        if is_far {
            self.n_refused += 1;
            if self.n_refused < INSISTENT {
                return;
            }
            for axis in 0..3 {
                self.covariance[(VELOCITY + axis, VELOCITY + axis)] += INSISTED_MPS * INSISTED_MPS;
            }
        }
        self.n_refused = 0;
        self.update(&h, &residual, variance);
        self.last_velocity = Some(told.stamp);
    }

    /// Turns the level axes until the body moves as it is told. If its own velocity is not known, it moves along its x axis.
    fn find_north(&mut self, velocity: &Vector3<f64>, told: &GroundVelocity) {
        let variance = self.covariance.fixed_view::<3, 3>(VELOCITY, VELOCITY).trace();
        let is_known = variance.sqrt() < 0.3 * velocity.norm();
        let way = if is_known { *velocity } else { self.turn * Vector3::x() };
        let way = self.level_from_begin * way;
        let [east, north] = told.east_north;
        let by = north.atan2(east) - way.y.atan2(way.x);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), by);
        let mut change = SMatrix::<f64, N, N>::identity();
        change.fixed_view_mut::<3, 3>(ATTITUDE, ATTITUDE).copy_from(turn.to_rotation_matrix().matrix());
        self.level_from_begin = turn * self.level_from_begin;
        self.covariance = change * self.covariance * change.transpose();
        self.shared *= change.transpose();
        let heading = if is_known { (variance.sqrt() + told.sigma) / told.speed() } else { SLIP };
        self.covariance[(ATTITUDE + 2, ATTITUDE + 2)] += heading * heading;
        self.north_is_known = true;
    }
}
