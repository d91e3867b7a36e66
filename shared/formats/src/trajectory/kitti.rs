//! KITTI (Geiger et al., CVPR 2012): the upper three rows of the 4x4 matrix, row-major, 12 numbers per line. A
//! separate file `times.txt` has the times in seconds, one per line.

use super::line::{ROTATION_TOLERANCE, content_lines, parse_numbers, parse_stamp};
use super::{PoseFault, TrajectoryError};
use geometry::{Isometry3, Pose, Stamp, Trajectory, Translation3, UnitQuaternion};
use nalgebra::{Matrix3, Rotation3};
use std::fmt::Write;

/// The trajectory in KITTI format.
pub fn kitti_from_trajectory(trajectory: &Trajectory) -> String {
    let mut text = String::new();
    for (_, pose) in trajectory.poses() {
        let m = pose.to_homogeneous();
        let numbers: Vec<String> = (0..12).map(|i| m[(i / 4, i % 4)].to_string()).collect();
        text.push_str(&numbers.join(" "));
        text.push('\n');
    }
    text
}

/// Reads KITTI format: one pose per line, without times.
pub fn poses_from_kitti(text: &str) -> Result<Vec<Pose>, TrajectoryError> {
    content_lines(text)
        .map(|(line, fields)| parse_matrix(fields).map_err(|fault| TrajectoryError { line, fault }))
        .collect()
}

/// Content of the `times.txt` of a KITTI file.
pub fn times_from_trajectory(trajectory: &Trajectory) -> String {
    let mut text = String::new();
    for (stamp, _) in trajectory.poses() {
        let _ = writeln!(text, "{stamp}");
    }
    text
}

/// Reads a `times.txt`: seconds that do not decrease.
pub fn times_from_kitti(text: &str) -> Result<Vec<Stamp>, TrajectoryError> {
    let mut times: Vec<Stamp> = Vec::new();
    for (line, field) in content_lines(text) {
        let error = |fault: PoseFault| TrajectoryError { line, fault };
        let stamp = parse_stamp(field).map_err(error)?;
        if times.last().is_some_and(|last| stamp < *last) {
            return Err(error(PoseFault::TimeDecreases { stamp }));
        }
        times.push(stamp);
    }
    Ok(times)
}

fn parse_matrix(fields: &str) -> Result<Pose, PoseFault> {
    let [a, b, c, x, d, e, f, y, g, h, i, z] = parse_numbers(fields)?;
    let matrix = Matrix3::new(a, b, c, d, e, f, g, h, i);
    let deviation = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    if deviation > ROTATION_TOLERANCE || matrix.determinant() < 0.0 {
        return Err(PoseFault::Rotation { deviation, determinant: matrix.determinant() });
    }
    // A matrix of 6 digits is a rotation to 6 digits only, so the quaternion is normalized.
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    let rotation = UnitQuaternion::new_normalize(rotation.into_inner());
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kitti_is_row_major() {
        // 90 degrees left: x forward becomes y.
        let [pose] = poses_from_kitti("0 -1 0 5\t1 0 0 6 0 0 1 7\n").expect("parses").try_into().expect("one");
        assert!((pose * nalgebra::Point3::new(1.0, 0.0, 0.0) - nalgebra::Point3::new(5.0, 7.0, 7.0)).norm() < 1e-15);
    }

    #[test]
    fn matrix_of_few_digits_is_accepted_and_reflection_is_refused() {
        let [pose] = poses_from_kitti("0.866 -0.5 0 0 0.5 0.866 0 0 0 0 1 0").expect("parses").try_into().expect("one");
        assert!((pose.rotation.norm() - 1.0).abs() < 1e-15);
        assert!((pose.rotation.angle().to_degrees() - 30.0).abs() < 0.01);
        let mirrored = poses_from_kitti("-1 0 0 0 0 1 0 0 0 0 1 0\n").expect_err("is a mirror");
        assert!(mirrored.to_string().contains("not a rotation"));
    }

    #[test]
    fn decreasing_times_are_refused() {
        assert_eq!(times_from_kitti("0.0\n1.036224e-01\n0.2\n"), Ok([0, 103_622_400, 200_000_000].map(Stamp).to_vec()));
        let error = times_from_kitti("1\n0.5\n").expect_err("falls");
        assert_eq!((error.line, error.to_string().contains("before the time of the previous line")), (2, true));
    }
}
