//! The trajectory of a run in third-party formats.

mod geojson;
mod sbet;

use crate::error::DeliverError;
use crate::run_folder::{Georeference, RunFolder};
use crate::target_frame::TargetFrame;
use files::atomic_file::write_atomic;
use formats::trajectory::{csv_from_trajectory, kitti_from_trajectory, times_from_trajectory, tum_from_trajectory};
use geometry::{Isometry3, Point3, Pose, Trajectory, Translation3, UnitQuaternion, Vector3};
use std::path::Path;

/// Writes the trajectory into the existing folder `out` as TUM, KITTI with times, and CSV in coordinates of the delivery.
/// If the run is georeferenced and `frame` is not a local frame, also as GeoJSON and SBET. Returns the names of the
/// files.
pub fn write_trajectory(
    run: &RunFolder,
    frame: &TargetFrame<'_>,
    out: &Path,
) -> Result<Vec<&'static str>, DeliverError> {
    let moved = in_frame(&run.trajectory, frame)?;
    let mut files = vec![
        ("trajectory.txt", tum_from_trajectory(&moved).into_bytes()),
        ("trajectory_kitti.txt", kitti_from_trajectory(&moved).into_bytes()),
        ("trajectory_kitti_times.txt", times_from_trajectory(&moved).into_bytes()),
        ("trajectory.csv", csv_from_trajectory(&moved).into_bytes()),
    ];
    let local = run.georeference.as_ref().and_then(Georeference::local).filter(|_| frame.crs().is_some());
    if let Some(local) = local {
        files.push(("trajectory.geojson", geojson::text(&run.trajectory, local).into_bytes()));
        files.push(("trajectory.sbet", sbet::bytes(&run.trajectory, local)));
    }
    for (name, content) in &files {
        let path = out.join(name);
        write_atomic(&path, content).map_err(DeliverError::file(&path, "write"))?;
    }
    Ok(files.into_iter().map(|(name, _)| name).collect())
}

/// Poses in coordinates of the delivery. Rotations refer to its axes: grid north is not true north.
fn in_frame(trajectory: &Trajectory, frame: &TargetFrame<'_>) -> Result<Trajectory, DeliverError> {
    let mut moved = Trajectory::default();
    for (stamp, pose) in trajectory.poses() {
        let p = Point3::from(pose.translation.vector);
        let translation = Translation3::from(Vector3::from(frame.from_local(&p)?));
        let rotation = rotation_at(&p, |p| Ok::<_, DeliverError>(frame.from_local(p)?))?;
        moved.push(*stamp, Pose::from_parts(translation, rotation * pose.rotation));
    }
    Ok(moved)
}

/// Rotation of a map near a point. The map may scale lengths slightly, as projections do.
fn rotation_at<E>(
    p: &Point3<f64>,
    map: impl Fn(&Point3<f64>) -> Result<[f64; 3], E>,
) -> Result<UnitQuaternion<f64>, E> {
    // Map coordinates have 1e-9 m of noise, so a step of 10 m gives angles to 1e-10.
    const STEP_M: f64 = 10.0;
    let along = |axis: Vector3<f64>| -> Result<Vector3<f64>, E> {
        let step = axis * STEP_M;
        Ok((Vector3::from(map(&(p + step))?) - Vector3::from(map(&(p - step))?)).normalize())
    };
    let x = along(Vector3::x())?;
    let y = along(Vector3::y())?;
    let z = x.cross(&y).normalize();
    Ok(UnitQuaternion::from_basis_unchecked(&[x, z.cross(&x), z]))
}

/// Attitude of a pose relative to east, north and up at its own position, where the vertical differs from the vertical at
/// the origin.
fn level_pose(pose: &Pose, local: &geometry::LocalFrame) -> Pose {
    let p = Point3::from(pose.translation.vector);
    let here = geometry::LocalFrame::new(local.geodetic_from_world(&p));
    let map = |p: &Point3<f64>| {
        Ok::<_, std::convert::Infallible>(here.world_from_geodetic(&local.geodetic_from_world(p)).coords.into())
    };
    let Ok(rotation) = rotation_at(&p, map);
    Isometry3::from_parts(Translation3::identity(), rotation * pose.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Geodetic, LocalFrame};

    #[test]
    fn level_differs_from_that_of_the_origin_by_the_curvature_of_the_earth() {
        let local = LocalFrame::new(Geodetic::new(48.846_222, 2.346_414, 104.6).expect("a position"));
        // 6370 m north: a thousandth of a radian.
        let pose = Pose::translation(0.0, 6370.0, 0.0);
        let level = level_pose(&pose, &local);
        let (roll, pitch, yaw) = level.rotation.euler_angles();
        assert!((roll.abs() - 1e-3).abs() < 2e-5 && pitch.abs() < 1e-6 && yaw.abs() < 1e-6, "{roll} {pitch} {yaw}");
    }
}
