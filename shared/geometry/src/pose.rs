//! Poses and trajectories.

use crate::Stamp;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// A rigid transform, lengths in m. Variables are named by its direction: `odom_from_body` takes points of the body to odom.
pub type Pose = Isometry3<f64>;

/// Interpolates from `a` (share 0) to `b` (share 1): translation linearly, rotation along the shorter arc. Shares outside 0 to 1
/// extrapolate.
pub fn interpolate(a: &Pose, b: &Pose, share: f64) -> Pose {
    let translation = a.translation.vector.lerp(&b.translation.vector, share);
    let rotation_a_from_b = a.rotation.inverse() * b.rotation;
    let rotation = a.rotation * UnitQuaternion::from_scaled_axis(rotation_a_from_b.scaled_axis() * share);
    Isometry3::from_parts(Translation3::from(translation), rotation)
}

/// The rotation about z that has the same forward direction.
pub fn heading(rotation: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let forward = rotation * Vector3::x();
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), forward.y.atan2(forward.x))
}

/// Poses of one frame relative to another over time, by default of the body: relative to odom before georeferencing
/// (`odom_from_body`), relative to the world after it and in the truth of a simulated drive (`world_from_body`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    poses: Vec<(Stamp, Pose)>,
}

impl Trajectory {
    /// Appends a pose. A stamp equal to the last one replaces the last pose. A stamp before the last one is rejected: the result
    /// is `false`.
    pub fn push(&mut self, stamp: Stamp, new: Pose) -> bool {
        match self.poses.last_mut() {
            Some((last, _)) if stamp < *last => return false,
            Some((last, pose)) if stamp == *last => *pose = new,
            _ => self.poses.push((stamp, new)),
        }
        true
    }
    /// All poses in order.
    pub fn poses(&self) -> &[(Stamp, Pose)] {
        &self.poses
    }
    /// Removes poses that interpolation at or after `stamp` does not need.
    pub fn forget_before(&mut self, stamp: Stamp) {
        let keep_from = self.poses.partition_point(|(s, _)| *s <= stamp).saturating_sub(1);
        self.poses.drain(..keep_from);
    }
    /// The pose at `stamp`, interpolated; `None` before the first or after the last pose.
    pub fn at(&self, stamp: Stamp) -> Option<Pose> {
        let after = self.poses.partition_point(|(s, _)| *s < stamp);
        let (stamp_b, b) = self.poses.get(after)?;
        if *stamp_b == stamp {
            return Some(*b);
        }
        let (stamp_a, a) = self.poses.get(after.checked_sub(1)?)?;
        Some(interpolate(a, b, stamp.seconds_since(*stamp_a) / stamp_b.seconds_since(*stamp_a)))
    }
    /// Length of the path, m.
    pub fn length_m(&self) -> f64 {
        self.poses.windows(2).map(|pair| (pair[1].1.translation.vector - pair[0].1.translation.vector).norm()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(x: f64, yaw: f64) -> Pose {
        Isometry3::new(Vector3::new(x, 0.0, 0.0), Vector3::z() * yaw)
    }

    #[test]
    fn poses_are_interpolated_inside_and_absent_outside() {
        let mut trajectory = Trajectory::default();
        assert!(trajectory.push(Stamp(0), pose(0.0, 0.0)));
        assert!(trajectory.push(Stamp(100), pose(2.0, 0.4)));
        assert!(!trajectory.push(Stamp(50), pose(9.0, 9.0)));
        let quarter = trajectory.at(Stamp(25)).expect("inside");
        assert!((quarter.translation.x - 0.5).abs() < 1e-12);
        assert!((quarter.rotation.angle() - 0.1).abs() < 1e-12);
        assert_eq!(trajectory.at(Stamp(-1)), None);
        assert_eq!(trajectory.at(Stamp(101)), None);
        assert_eq!(trajectory.at(Stamp(100)), Some(pose(2.0, 0.4)));
        trajectory.forget_before(Stamp(60));
        assert_eq!(trajectory.poses().len(), 2);
    }
}
