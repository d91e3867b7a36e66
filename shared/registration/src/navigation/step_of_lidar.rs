//! The lidar's step by the body's.

use super::{N, PLACE, TURN, symmetric};
use crate::SensorPlaces;
use geometry::{Isometry3, Pose, Translation3, UnitQuaternion, Vector3};
use nalgebra::{Matrix6, SMatrix};

/// The lidar on the body's step.
pub(super) struct StepOfLidar {
    /// `odom_from_body` without its place, at the step's begin.
    odom_from_begin: UnitQuaternion<f64>,
    from: Pose,
    body_from_lidar: UnitQuaternion<f64>,
    /// From the inertial unit, body axes, m.
    arm: Vector3<f64>,
    /// Of the lidar's pose (odom axes) by the filter's errors.
    pub jacobian: SMatrix<f64, 6, N>,
}

impl StepOfLidar {
    pub fn new(places: &SensorPlaces, from: &Pose, turn: &UnitQuaternion<f64>) -> Self {
        let body_from_lidar = places.body_from_lidar.rotation;
        let odom_from_begin = from.rotation * body_from_lidar.inverse();
        let arm = places.body_from_lidar.translation.vector - places.imu_in_body.coords;
        let axes = *odom_from_begin.to_rotation_matrix().matrix();
        let mut jacobian = SMatrix::<f64, 6, N>::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, PLACE).copy_from(&axes);
        jacobian.fixed_view_mut::<3, 3>(0, TURN).copy_from(&(-axes * (turn * arm).cross_matrix()));
        jacobian.fixed_view_mut::<3, 3>(3, TURN).copy_from(&axes);
        Self { odom_from_begin, from: *from, body_from_lidar, arm, jacobian }
    }
    pub fn pose(&self, way: &Vector3<f64>, turn: &UnitQuaternion<f64>) -> Pose {
        let way = way + turn * self.arm - self.arm;
        let mut rotation = self.odom_from_begin * turn * self.body_from_lidar;
        rotation.renormalize();
        Isometry3::from_parts(Translation3::from(self.from.translation.vector + self.odom_from_begin * way), rotation)
    }
    pub fn covariance(&self, covariance: &SMatrix<f64, N, N>) -> Matrix6<f64> {
        symmetric(&(self.jacobian * covariance * self.jacobian.transpose()))
    }
}
