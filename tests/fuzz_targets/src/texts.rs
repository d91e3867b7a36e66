//! Trajectories and lens calibrations.

use crate::accepted::accepted;
use formats::ladybug::LadybugCalibration;
use formats::trajectory::{
    TrajectoryError, poses_from_kitti, times_from_kitti, trajectory_from_csv, trajectory_from_tum,
};
use geometry::Trajectory;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn check(read: Result<Trajectory, TrajectoryError>) {
    accepted(&read);
    if let Ok(trajectory) = read {
        assert!(trajectory.poses().is_sorted_by_key(|(stamp, _)| *stamp));
    }
}

pub(crate) fn tum(bytes: &[u8]) {
    check(trajectory_from_tum(&text(bytes)));
}

pub(crate) fn trajectory_csv(bytes: &[u8]) {
    check(trajectory_from_csv(&text(bytes)));
}

pub(crate) fn kitti_poses(bytes: &[u8]) {
    let read = poses_from_kitti(&text(bytes));
    accepted(&read);
    if let Ok(poses) = read {
        assert!(poses.iter().all(|pose| (pose.rotation.norm() - 1.0).abs() < 1e-9));
    }
    let _ = times_from_kitti(&text(bytes));
}

pub(crate) fn ladybug(bytes: &[u8]) {
    accepted(&text(bytes).parse::<LadybugCalibration>());
}
