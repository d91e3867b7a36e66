//! Trajectories, lens calibrations, check points and grids of geoids.

use crate::accepted::accepted;
use formats::gtx::GeoidGrid;
use formats::ladybug::LadybugCalibration;
use formats::ntv2::DatumGrid;
use formats::trajectory::{
    TrajectoryError, poses_from_kitti, times_from_kitti, trajectory_from_csv, trajectory_from_tum,
};
use geometry::Trajectory;
use surveying::check_points::check_points_from_csv;

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

pub(crate) fn check_points(bytes: &[u8]) {
    let read = check_points_from_csv(&text(bytes));
    accepted(&read);
    if let Ok(points) = read {
        assert!(points.iter().flat_map(|point| point.xyz).all(f64::is_finite));
    }
}

pub(crate) fn geoid_grid(bytes: &[u8]) {
    let read = GeoidGrid::decode(bytes);
    accepted(&read);
    if let Ok(grid) = read {
        let places = (-6..=6).flat_map(|i| (-12..=12).map(move |j| [f64::from(i) * 15.0, f64::from(j) * 15.0]));
        let heights = places.filter_map(|[latitude_deg, longitude_deg]| grid.height(latitude_deg, longitude_deg));
        assert!(heights.into_iter().all(|height| !height.is_nan()));
    }
}

pub(crate) fn datum_grid(bytes: &[u8]) {
    let read = DatumGrid::decode(bytes);
    accepted(&read);
    if let Ok(grid) = read {
        for [latitude, longitude] in
            (-6..=6).flat_map(|i| (-12..=12).map(move |j| [f64::from(i) * 15.0, f64::from(j) * 15.0]))
        {
            for found in
                [grid.forward([latitude, longitude]), grid.inverse([latitude, longitude])].into_iter().flatten()
            {
                assert!(found.iter().all(|value| value.is_finite()), "{latitude} {longitude}: {found:?}");
            }
        }
    }
}

pub(crate) fn ladybug(bytes: &[u8]) {
    accepted(&text(bytes).parse::<LadybugCalibration>());
}
