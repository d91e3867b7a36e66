//! The tangent space of poses: translation along the pose's own axes (m), then rotation vector (rad).

use geometry::{Isometry3, Pose, Translation3, UnitQuaternion};
use nalgebra::{Matrix3, Vector3, Vector6};

/// Cross-product matrix: `skew(a) * b` is `a x b`.
pub fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// The pose after a motion in its own axes.
pub fn moved(pose: &Pose, motion: &Vector6<f64>) -> Pose {
    let mut rotation = pose.rotation * UnitQuaternion::from_scaled_axis(motion.fixed_rows::<3>(3).into_owned());
    // Rounding makes products of unit quaternions drift from unit length; messages check the length.
    rotation.renormalize();
    let translation = pose.translation.vector + pose.rotation * motion.fixed_rows::<3>(0);
    Isometry3::from_parts(Translation3::from(translation), rotation)
}

/// The inverse right Jacobian of SO(3) (Forster et al. 2017, eq. 9), to the fourth order: the change of a rotation vector
/// when a small rotation follows. At 0.5 rad the next term is 2e-5.
pub fn inverse_right_jacobian(rotation: &Vector3<f64>) -> Matrix3<f64> {
    let s = skew(rotation);
    let square = s * s;
    Matrix3::identity() + s * 0.5 + square / 12.0 - square * square / 720.0
}
