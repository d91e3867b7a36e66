//! KITTI (Geiger et al., CVPR 2012): the upper three rows of the 4x4 matrix, row-major, 12 numbers a line. Times stand in a
//! file of their own, `times.txt`, seconds, one a line.

use super::TrajectoryError;
use super::line::{ROTATION_TOLERANCE, content_lines, parse_numbers, parse_stamp};
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

/// Reads KITTI format: one pose a line, without times.
pub fn poses_from_kitti(text: &str) -> Result<Vec<Pose>, TrajectoryError> {
    content_lines(text)
        .map(|(line, fields)| parse_matrix(fields).map_err(|rule| TrajectoryError { line, rule }))
        .collect()
}

/// The times that go with the poses of a KITTI file: the text of a `times.txt`.
pub fn times_from_trajectory(trajectory: &Trajectory) -> String {
    let mut text = String::new();
    for (stamp, _) in trajectory.poses() {
        let _ = writeln!(text, "{stamp}");
    }
    text
}

/// Reads a `times.txt`: seconds, which may not fall.
pub fn times_from_kitti(text: &str) -> Result<Vec<Stamp>, TrajectoryError> {
    let mut times: Vec<Stamp> = Vec::new();
    for (line, field) in content_lines(text) {
        let fault = |rule: String| TrajectoryError { line, rule };
        let stamp = parse_stamp(field).map_err(fault)?;
        if times.last().is_some_and(|last| stamp < *last) {
            return Err(fault(format!("time {stamp} is before that of the line above")));
        }
        times.push(stamp);
    }
    Ok(times)
}

fn parse_matrix(fields: &str) -> Result<Pose, String> {
    let [a, b, c, x, d, e, f, y, g, h, i, z] = parse_numbers(fields)?;
    let matrix = Matrix3::new(a, b, c, d, e, f, g, h, i);
    let defect = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    if defect > ROTATION_TOLERANCE || matrix.determinant() < 0.0 {
        return Err(format!(
            "the left 3x3 is no rotation: M M^T is off by {defect}, determinant {}",
            matrix.determinant()
        ));
    }
    // A matrix of 6 digits is a rotation to 6 digits; the quaternion's norm must not keep what is missing.
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
    fn a_rotation_of_few_digits_is_a_rotation_and_a_mirror_is_none() {
        let [pose] = poses_from_kitti("0.866 -0.5 0 0 0.5 0.866 0 0 0 0 1 0").expect("parses").try_into().expect("one");
        assert!((pose.rotation.norm() - 1.0).abs() < 1e-15);
        assert!((pose.rotation.angle().to_degrees() - 30.0).abs() < 0.01);
        let mirrored = poses_from_kitti("-1 0 0 0 0 1 0 0 0 0 1 0\n").expect_err("is a mirror");
        assert!(mirrored.rule.contains("no rotation"));
    }

    #[test]
    fn times_are_read_and_must_not_fall() {
        assert_eq!(times_from_kitti("0.0\n1.036224e-01\n0.2\n"), Ok([0, 103_622_400, 200_000_000].map(Stamp).to_vec()));
        let error = times_from_kitti("1\n0.5\n").expect_err("falls");
        assert_eq!((error.line, error.rule.contains("before that of the line above")), (2, true));
    }
}
