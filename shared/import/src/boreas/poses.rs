//! True poses: `lidar_poses.csv`, one per sweep.

use crate::error::{At, ImportError};
use crate::stamp_text::nanos;
use files::text_file::read_long_text;
use geometry::{Isometry3, Pose, Stamp, Trajectory, UnitQuaternion, Vector3};
use std::path::Path;

/// Columns that are read.
const COLUMNS: [&str; 7] = ["GPSTime", "easting", "northing", "altitude", "roll", "pitch", "heading"];

/// Poses of the body in the frame of east, north and up at the first one.
pub(super) fn read(path: &Path, lidar_from_body: &Pose) -> Result<Trajectory, ImportError> {
    let text = read_long_text(path).at(path)?;
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
    let header: Vec<&str> = lines.next().map(|(_, line)| line.split(',').map(str::trim).collect()).unwrap_or_default();
    let mut columns = [0; COLUMNS.len()];
    for (column, name) in columns.iter_mut().zip(COLUMNS) {
        let found = header.iter().position(|found| *found == name);
        *column = found.ok_or_else(|| {
            ImportError::at_line(path, 1, format!("has no column {name}; expected {}", COLUMNS.join(",")))
        })?;
    }
    let mut trajectory = Trajectory::default();
    let mut origin: Option<Vector3<f64>> = None;
    for (number, line) in lines {
        let words: Vec<&str> = line.split(',').map(str::trim).collect();
        let word = |index: usize| words.get(columns[index]).copied().unwrap_or_default();
        let fault = |index: usize, rule: &str| {
            ImportError::at_line(path, number, format!("{} is {:?}; it must be {rule}", COLUMNS[index], word(index)))
        };
        let stamp = nanos(word(0)).ok_or_else(|| fault(0, "a time since 1970"))?;
        let mut values = [0.0; 6];
        for (index, value) in (1..).zip(&mut values) {
            let number = word(index).parse().ok().filter(|value: &f64| value.is_finite());
            *value = number.ok_or_else(|| fault(index, "a number"))?;
        }
        let [x, y, z, roll, pitch, yaw] = values;
        // The angles belong to the inverse: C_enu_lidar = C1(roll) C2(pitch) C3(yaw), each of which rotates the frame.
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw).inverse();
        let mut world_from_body = Isometry3::from_parts([x, y, z].into(), rotation) * lidar_from_body;
        let position = world_from_body.translation.vector;
        world_from_body.translation.vector -= *origin.get_or_insert(position);
        let is_after = trajectory.poses().last().is_none_or(|(last, _)| last.0 < stamp);
        if !is_after || !trajectory.push(Stamp(stamp), world_from_body) {
            return Err(fault(0, "later than in the previous line"));
        }
    }
    if trajectory.poses().is_empty() {
        return Err(ImportError::at(path, "has no poses"));
    }
    Ok(trajectory)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    #[test]
    fn angles_turn_the_frame_about_z_then_y_then_x() {
        let [roll, pitch, yaw] = [0.3_f64, -0.2, 2.5];
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("lidar_poses.csv");
        let text = format!("{}\n1630597330954834,1,2,3,{roll},{pitch},{yaw}\n", COLUMNS.join(","));
        std::fs::write(&path, text).expect("writes");
        let trajectory = read(&path, &Pose::identity()).expect("reads");
        let (stamp, pose) = trajectory.poses()[0];
        assert_eq!(stamp.0, 1_630_597_330_954_834_000);
        let [sx, sy, sz] = [roll, pitch, yaw].map(f64::sin);
        let [cx, cy, cz] = [roll, pitch, yaw].map(f64::cos);
        let about_x = Matrix3::new(1.0, 0.0, 0.0, 0.0, cx, sx, 0.0, -sx, cx);
        let about_y = Matrix3::new(cy, 0.0, -sy, 0.0, 1.0, 0.0, sy, 0.0, cy);
        let about_z = Matrix3::new(cz, sz, 0.0, -sz, cz, 0.0, 0.0, 0.0, 1.0);
        let expected = about_x * about_y * about_z;
        assert!((pose.rotation.to_rotation_matrix().matrix() - expected).amax() < 1e-12, "{pose}");
    }
}
