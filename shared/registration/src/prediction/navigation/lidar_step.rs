//! The step of the LiDAR, derived from the step of the body.

use super::{N, POSITION, ROTATION, symmetric};
use crate::SensorMounting;
use geometry::{Isometry3, Pose, Translation3, UnitQuaternion, Vector3};
use nalgebra::{Matrix6, SMatrix};

/// Geometry of a LiDAR on the body.
pub(super) struct LidarStep {
    /// Rotation of `odom_from_body` at the start of the step.
    odom_from_begin: UnitQuaternion<f64>,
    from: Pose,
    body_from_lidar: UnitQuaternion<f64>,
    /// Lever arm from the inertial unit to the LiDAR, body axes, m.
    arm: Vector3<f64>,
    /// Derivative of the LiDAR's pose (odom axes) with respect to the error states.
    pub jacobian: SMatrix<f64, 6, N>,
}

impl LidarStep {
    pub fn new(mounting: &SensorMounting, from: &Pose, rotation: &UnitQuaternion<f64>) -> Self {
        let body_from_lidar = mounting.body_from_lidar.rotation;
        let odom_from_begin = from.rotation * body_from_lidar.inverse();
        let arm = mounting.body_from_lidar.translation.vector - mounting.imu_in_body.coords;
        let axes = *odom_from_begin.to_rotation_matrix().matrix();
        let mut jacobian = SMatrix::<f64, 6, N>::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, POSITION).copy_from(&axes);
        jacobian.fixed_view_mut::<3, 3>(0, ROTATION).copy_from(&(-axes * (rotation * arm).cross_matrix()));
        jacobian.fixed_view_mut::<3, 3>(3, ROTATION).copy_from(&axes);
        Self { odom_from_begin, from: *from, body_from_lidar, arm, jacobian }
    }
    /// The LiDAR's pose after a displacement of the inertial unit and a rotation of the body.
    pub fn pose(&self, displacement: &Vector3<f64>, rotation: &UnitQuaternion<f64>) -> Pose {
        let displacement = displacement + rotation * self.arm - self.arm;
        let mut odom_from_lidar = self.odom_from_begin * rotation * self.body_from_lidar;
        odom_from_lidar.renormalize();
        let position = self.from.translation.vector + self.odom_from_begin * displacement;
        Isometry3::from_parts(Translation3::from(position), odom_from_lidar)
    }
    pub fn covariance(&self, covariance: &SMatrix<f64, N, N>) -> Matrix6<f64> {
        symmetric(&(self.jacobian * covariance * self.jacobian.transpose()))
    }
}
