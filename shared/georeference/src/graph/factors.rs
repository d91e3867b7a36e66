//! Residuals of the measurements and their derivatives.

use super::measurements::{AntennaPosition, HorizontalVelocity, RelativeError, RelativePose, UpDirection};
use super::tangent::{inverse_right_jacobian, skew};
use geometry::Pose;
use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};

/// A residual over two submaps and its derivatives with respect to motions of both.
pub struct RelativeFactor {
    pub residual: Vector6<f64>,
    pub by_target: Matrix6<f64>,
    pub by_source: Matrix6<f64>,
}

/// A whitened residual over one submap: its squared norm is its chi squared.
pub struct UnaryFactor {
    pub residual: Vector3<f64>,
    pub jacobian: Matrix3x6<f64>,
}

impl RelativeFactor {
    pub fn new(relative: &RelativePose, world_from_target: &Pose, world_from_source: &Pose) -> Self {
        let RelativeError { translation, rotation } = relative.error(world_from_target, world_from_source);
        let target_from_source = world_from_target.inv_mul(world_from_source);
        let axes = *target_from_source.rotation.to_rotation_matrix().matrix();
        let jacobian = inverse_right_jacobian(&rotation);
        let mut factor = Self { residual: Vector6::zeros(), by_target: Matrix6::zeros(), by_source: Matrix6::zeros() };
        factor.residual.fixed_rows_mut::<3>(0).copy_from(&translation);
        factor.residual.fixed_rows_mut::<3>(3).copy_from(&rotation);
        let by_target = &mut factor.by_target;
        by_target.fixed_view_mut::<3, 3>(0, 0).copy_from(&-Matrix3::identity());
        by_target.fixed_view_mut::<3, 3>(0, 3).copy_from(&skew(&target_from_source.translation.vector));
        by_target.fixed_view_mut::<3, 3>(3, 3).copy_from(&(-jacobian * axes.transpose()));
        factor.by_source.fixed_view_mut::<3, 3>(0, 0).copy_from(&axes);
        factor.by_source.fixed_view_mut::<3, 3>(3, 3).copy_from(&jacobian);
        factor
    }
    pub fn chi_squared(&self, information: &Matrix6<f64>) -> f64 {
        self.residual.dot(&(information * self.residual))
    }
}

impl UnaryFactor {
    pub fn from_position(position: &AntennaPosition, world_from_submap: &Pose) -> Self {
        let axes = world_from_submap.rotation.to_rotation_matrix();
        let error = world_from_submap * position.p_in_submap - position.p_in_world;
        let mut sigma_m = Vector3::from(position.sigma_m);
        if error.z < 0.0 {
            sigma_m.z = position.sigma_above_m;
        }
        let per_sigma = Matrix3::from_diagonal(&sigma_m.map(f64::recip));
        let mut jacobian = Matrix3x6::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&(per_sigma * axes.matrix()));
        let by_rotation = -axes.matrix() * skew(&position.p_in_submap.coords);
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&(per_sigma * by_rotation));
        Self { residual: per_sigma * error, jacobian }
    }
    pub fn from_velocity(velocity: &HorizontalVelocity, world_from_submap: &Pose) -> Self {
        let axes = world_from_submap.rotation.to_rotation_matrix();
        let [east, north] = velocity.v_in_world;
        let mut error = axes * velocity.v_in_submap - Vector3::new(east, north, 0.0);
        let mut by_rotation = -axes.matrix() * skew(&velocity.v_in_submap);
        // The receiver reports no vertical velocity.
        error.z = 0.0;
        by_rotation.row_mut(2).fill(0.0);
        let mut jacobian = Matrix3x6::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&(by_rotation / velocity.sigma_mps));
        Self { residual: error / velocity.sigma_mps, jacobian }
    }
    pub fn from_up_direction(up_direction: &UpDirection, world_from_submap: &Pose) -> Self {
        let up = world_from_submap.rotation.inverse() * Vector3::z();
        let mut jacobian = Matrix3x6::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&(skew(&up) / up_direction.sigma_rad));
        Self { residual: (up - up_direction.up_in_submap) / up_direction.sigma_rad, jacobian }
    }
    pub fn chi_squared(&self) -> f64 {
        self.residual.norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tangent::moved;
    use super::*;
    use geometry::{Isometry3, Point3, UnitQuaternion};

    fn pose(seed: f64) -> Pose {
        let at = |k: f64| (seed * 7.31 + k * 2.17).sin();
        Isometry3::new(
            Vector3::new(9.0 * at(1.0), 9.0 * at(2.0), at(3.0)),
            Vector3::new(at(4.0), at(5.0), at(6.0)) * 0.4,
        )
    }

    fn step(axis: usize) -> Vector6<f64> {
        Vector6::from_fn(|row, _| if row == axis { 1e-6 } else { 0.0 })
    }

    #[test]
    fn derivatives_equal_finite_differences() {
        let a = pose(0.3);
        let b = pose(0.9);
        let slightly = Isometry3::new(Vector3::new(0.2, -0.1, 0.1), Vector3::new(0.03, -0.05, 0.2));
        let relative = RelativePose {
            target: 0,
            source: 1,
            target_from_source: a.inv_mul(&b) * slightly,
            information: Matrix6::identity(),
        };
        let position = AntennaPosition {
            submap: 0,
            p_in_submap: Point3::new(3.0, -4.0, 1.5),
            p_in_world: Point3::new(1.0, 2.0, 3.0),
            sigma_m: [0.5, 0.7, 2.0],
            sigma_above_m: 4.0,
            share: 1.0,
            tolerance_m: 0.0,
        };
        let velocity = HorizontalVelocity {
            submap: 0,
            v_in_submap: Vector3::new(7.0, 1.0, 0.4),
            v_in_world: [5.0, -2.0],
            sigma_mps: 0.3,
        };
        let above = AntennaPosition { p_in_world: Point3::new(1.0, 2.0, -3.0), ..position };
        let up_in_submap = UnitQuaternion::from_euler_angles(0.1, -0.2, 0.0) * Vector3::z();
        let up_direction = UpDirection { submap: 0, up_in_submap, sigma_rad: 0.02 };
        let factor = RelativeFactor::new(&relative, &a, &b);
        for axis in 0..6 {
            let moved_a = moved(&a, &step(axis));
            let change = |after: RelativeFactor| (after.residual - factor.residual) * 1e6;
            let by_target = change(RelativeFactor::new(&relative, &moved_a, &b));
            assert!((by_target - factor.by_target.column(axis)).norm() < 1e-4, "target {axis}");
            let by_source = change(RelativeFactor::new(&relative, &a, &moved(&b, &step(axis))));
            assert!((by_source - factor.by_source.column(axis)).norm() < 1e-4, "source {axis}");
            for (before, after) in [
                (UnaryFactor::from_position(&position, &a), UnaryFactor::from_position(&position, &moved_a)),
                (UnaryFactor::from_position(&above, &a), UnaryFactor::from_position(&above, &moved_a)),
                (UnaryFactor::from_velocity(&velocity, &a), UnaryFactor::from_velocity(&velocity, &moved_a)),
                (
                    UnaryFactor::from_up_direction(&up_direction, &a),
                    UnaryFactor::from_up_direction(&up_direction, &moved_a),
                ),
            ] {
                let change = (after.residual - before.residual) * 1e6;
                assert!((change - before.jacobian.column(axis)).norm() < 2e-3, "{axis}: {change}");
            }
        }
    }
}
