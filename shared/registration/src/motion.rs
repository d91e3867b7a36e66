//! Motion during a sweep, and deskewing by it.

use geometry::{Isometry3, Pose, Translation3, UnitQuaternion, Vector3, interpolate};
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// Pose of the LiDAR during one sweep: the pose in the middle, and the change from first to last shot.
///
/// The pose at share s (-0.5 first shot, 0.5 last shot) has the position `mid + s * translation` and the rotation
/// `mid * exp(s * rotation)`: linear interpolation and slerp between both ends. The reference is the middle because an error
/// of the motion distorts the sweep symmetrically about it and therefore hardly shifts the match.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SweepMotion {
    /// `odom_from_lidar` half way between first and last shot.
    pub mid: Pose,
    /// Displacement from first to last shot, m, odom frame.
    pub translation: Vector3<f64>,
    /// Rotation vector from first to last shot, rad, LiDAR frame.
    pub rotation: Vector3<f64>,
}

impl SweepMotion {
    /// A LiDAR at rest.
    pub fn still(mid: Pose) -> Self {
        Self { mid, translation: Vector3::zeros(), rotation: Vector3::zeros() }
    }
    /// `odom_from_lidar` at `share` of the sweep, -0.5 to 0.5.
    pub fn at(&self, share: f64) -> Pose {
        Isometry3::from_parts(
            Translation3::from(self.mid.translation.vector + self.translation * share),
            self.mid.rotation * UnitQuaternion::from_scaled_axis(self.rotation * share),
        )
    }
    /// Rotates a vector from the LiDAR's axes at `share` of the sweep to odom, with `exp` to second order: the error at
    /// 0.05 rad is 2e-5 rad. `mid` is the rotation of [`SweepMotion::mid`].
    #[inline(always)]
    pub(crate) fn rotated(&self, mid: &Matrix3<f64>, v: &[f32; 3], share: f64) -> Vector3<f64> {
        let v = Vector3::from(*v).cast::<f64>();
        let rotation = self.rotation * share;
        let first = rotation.cross(&v);
        mid * (v + first + rotation.cross(&first) * 0.5)
    }
    /// `odom_from_lidar` at the first shot.
    pub fn begin(&self) -> Pose {
        self.at(-0.5)
    }
    /// `odom_from_lidar` at the last shot.
    pub fn end(&self) -> Pose {
        self.at(0.5)
    }
}

/// Linear and angular velocity in the LiDAR's own axes, so that constant velocity follows a curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Velocity {
    /// m/s.
    pub linear: Vector3<f64>,
    /// rad/s.
    pub angular: Vector3<f64>,
}

impl Velocity {
    /// Mean velocity from one pose to another, which is the velocity halfway in time. `seconds` is positive.
    pub fn between(from: &Pose, to: &Pose, seconds: f64) -> Self {
        let angular = (from.rotation.inverse() * to.rotation).scaled_axis() / seconds;
        let half_way = from.rotation * UnitQuaternion::from_scaled_axis(angular * (seconds / 2.0));
        let linear = half_way.inverse() * (to.translation.vector - from.translation.vector) / seconds;
        Self { linear, angular }
    }
    /// The velocity over a sweep of `duration_s` > 0.
    pub(crate) fn during(motion: &SweepMotion, duration_s: f64) -> Self {
        Self {
            linear: motion.mid.rotation.inverse() * motion.translation / duration_s,
            angular: motion.rotation / duration_s,
        }
    }
    /// The pose after `seconds` at this velocity.
    pub(crate) fn advance(&self, from: &Pose, seconds: f64) -> Pose {
        let half_rotation = UnitQuaternion::from_scaled_axis(self.angular * (seconds / 2.0));
        let half_way = from.rotation * half_rotation;
        let mut rotation = half_way * half_rotation;
        rotation.renormalize();
        Isometry3::from_parts(Translation3::from(from.translation.vector + half_way * self.linear * seconds), rotation)
    }
    /// The motion of a sweep of `duration_s` with this velocity at its middle.
    pub(crate) fn motion_at(&self, mid: Pose, duration_s: f64) -> SweepMotion {
        SweepMotion { mid, translation: mid.rotation * self.linear * duration_s, rotation: self.angular * duration_s }
    }
}

/// Poses of a sweep, tabulated over time, so that deskewing a point costs one look-up and one matrix product.
///
/// 2048 bins over a revolution of 100 ms are 49 µs each, one firing of the HDL-32E: the error is half a bin, below
/// 25 µrad and 0.5 mm at a yaw rate of 1 rad/s and 20 m/s.
#[derive(Clone, Debug)]
pub struct DeskewTable {
    /// Columns of the rotation, then the translation, each padded to a register of 16 bytes.
    bins: Vec<[[f32; 4]; 4]>,
    bins_per_nano: f64,
}

const BINS: usize = 2048;
/// Number of exact poses of a table after the first. Matrices between them are interpolated linearly; at 0.1 rad the
/// error is 3e-7 rad.
const NODES: usize = 64;

impl DeskewTable {
    /// Builds the table from the poses at the first and at the last shot, `target_from_lidar`, `duration_nanos` apart.
    /// The target frame must be near (some km at most): results are f32.
    pub fn new(begin: &Pose, end: &Pose, duration_nanos: u32) -> Self {
        let poses: Vec<Pose> =
            (0..=NODES).map(|number| interpolate(begin, end, number as f64 / NODES as f64)).collect();
        Self::along(&poses, duration_nanos)
    }
    /// Builds the table from at least two poses at evenly spaced times from the first to the last shot.
    pub fn along(poses: &[Pose], duration_nanos: u32) -> Self {
        let n_bins = if duration_nanos == 0 { 1 } else { BINS };
        let n_steps = poses.len() - 1;
        let node = |pose: &Pose| (*pose.rotation.to_rotation_matrix().matrix(), pose.translation.vector);
        let nodes: Vec<(Matrix3<f64>, Vector3<f64>)> = poses.iter().map(node).collect();
        let bins = (0..n_bins)
            .map(|bin| {
                let at = (bin as f64 + 0.5) * n_steps as f64 / n_bins as f64;
                let before = at as usize;
                let share = at.fract();
                let (rotation, translation) = nodes[before];
                let (next_rotation, next_translation) = nodes[before + 1];
                let rotation = rotation + (next_rotation - rotation) * share;
                let translation = translation + (next_translation - translation) * share;
                let padded = |v: Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32, 0.0];
                let column = |axis| padded(rotation.column(axis).into_owned());
                [column(0), column(1), column(2), padded(translation)]
            })
            .collect();
        Self { bins, bins_per_nano: n_bins as f64 / f64::from(duration_nanos.max(1)) }
    }
    /// The point, shot `offset_nanos` after the first one, in the target frame. Offsets past the end are clamped to the
    /// end.
    #[inline]
    pub fn deskew(&self, position: [f32; 3], offset_nanos: u32) -> [f32; 3] {
        // Uses `i32` because x86 has no conversion to `usize`.
        let bin = ((f64::from(offset_nanos) * self.bins_per_nano) as i32 as usize).min(self.bins.len() - 1);
        let [x, y, z, translation] = &self.bins[bin];
        let mut moved = [0.0; 4];
        for lane in 0..4 {
            moved[lane] = translation[lane] + (x[lane] * position[0] + y[lane] * position[1] + z[lane] * position[2]);
        }
        [moved[0], moved[1], moved[2]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;

    #[test]
    fn pose_during_sweep_equals_interpolation_between_both_ends() {
        let motion = SweepMotion {
            mid: Isometry3::new(Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.1, 0.2, 1.0)),
            translation: Vector3::new(1.0, 0.3, 0.0),
            rotation: Vector3::new(0.01, -0.02, 0.1),
        };
        for share in [0.0, 0.25, 0.5, 0.9, 1.0] {
            let between = interpolate(&motion.begin(), &motion.end(), share);
            let direct = motion.at(share - 0.5);
            assert!((between.translation.vector - direct.translation.vector).norm() < 1e-12);
            assert!(between.rotation.angle_to(&direct.rotation) < 1e-9);
        }
    }

    #[test]
    fn velocity_between_two_poses_advances_from_one_to_the_other() {
        let from = Isometry3::new(Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.1, 0.2, 1.0));
        let to = Isometry3::new(Vector3::new(4.0, -1.5, 1.1), Vector3::new(0.12, 0.18, 1.1));
        let velocity = Velocity::between(&from, &to, 0.1);
        let advanced = velocity.advance(&from, 0.1);
        assert!((advanced.translation.vector - to.translation.vector).norm() < 1e-12);
        assert!(advanced.rotation.angle_to(&to.rotation) < 1e-12);
        let again = Velocity::during(&velocity.motion_at(to, 0.1), 0.1);
        assert!((again.linear - velocity.linear).norm() + (again.angular - velocity.angular).norm() < 1e-12);
    }

    #[test]
    fn deskewed_points_of_one_target_coincide() {
        let begin = Isometry3::new(Vector3::new(5.0, 1.0, 0.0), Vector3::z() * 0.2);
        let end = Isometry3::new(Vector3::new(6.5, 1.2, 0.0), Vector3::new(0.01, 0.0, 0.28));
        let table = DeskewTable::new(&begin, &end, 100_000_000);
        let target = Point3::new(30.0, 10.0, 2.0);
        for offset in (0..=100_000_000_u32).step_by(3_333_333) {
            let pose = interpolate(&begin, &end, f64::from(offset) / 1e8);
            let seen = (pose.inverse() * target).cast::<f32>();
            let moved = table.deskew(seen.into(), offset);
            let error = (Point3::from(moved).cast::<f64>() - target).norm();
            // Half a bin of the table; without deskewing the error is up to 2 m.
            assert!(error < 1.5e-3, "{offset} ns: {error} m");
        }
    }
}
