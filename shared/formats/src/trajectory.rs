//! Trajectories as text: TUM and KITTI.
//!
//! TUM (Sturm et al., IROS 2012): one pose a line, `t tx ty tz qx qy qz qw`, seconds since the Unix epoch, m, unit
//! quaternion. KITTI (Geiger et al., CVPR 2012): the upper three rows of the 4x4 matrix, row-major, 12 numbers a line,
//! no times. Numbers are written with as many digits as it takes to read the same bits back.

use geometry::{Isometry3, Pose, Quaternion, Stamp, Trajectory, Translation3, UnitQuaternion};
use nalgebra::{Matrix3, Rotation3};
use std::fmt::Write;

/// A line that is no pose.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("line {line}: {rule}")]
pub struct TrajectoryError {
    /// Counted from 1.
    pub line: usize,
    /// What was found and what is allowed.
    pub rule: String,
}

/// How far a quaternion's norm or a matrix may be from a rotation: files carry as few as 6 digits.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// The trajectory in TUM format, stamps to the nanosecond.
pub fn tum_from_trajectory(trajectory: &Trajectory) -> String {
    let mut text = String::new();
    for (stamp, pose) in trajectory.poses() {
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{stamp} {} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w);
    }
    text
}

/// Reads TUM format. Empty lines and lines that start with `#` are passed over; stamps must not fall.
pub fn trajectory_from_tum(text: &str) -> Result<Trajectory, TrajectoryError> {
    let mut trajectory = Trajectory::default();
    for (line, fields) in content_lines(text) {
        let fault = |rule: String| TrajectoryError { line, rule };
        let (stamp, numbers) = fields.split_once(char::is_whitespace).unwrap_or((fields, ""));
        let stamp = parse_stamp(stamp).ok_or_else(|| fault(format!("{stamp:?} is no time in seconds")))?;
        let [x, y, z, qx, qy, qz, qw] =
            parse_numbers(numbers).map_err(|rule| fault(format!("after the time: {rule}")))?;
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        if (quaternion.norm() - 1.0).abs() > ROTATION_TOLERANCE {
            return Err(fault(format!("quaternion {qx} {qy} {qz} {qw} has norm {}, must be 1", quaternion.norm())));
        }
        let pose = Isometry3::from_parts(Translation3::new(x, y, z), unit(quaternion));
        if !trajectory.push(stamp, pose) {
            return Err(fault(format!("time {stamp} is before that of the line above")));
        }
    }
    Ok(trajectory)
}

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
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

/// Keeps the bits of a quaternion that is a unit as well as f64 can say it.
fn unit(quaternion: Quaternion<f64>) -> UnitQuaternion<f64> {
    if (quaternion.norm() - 1.0).abs() < 1e-15 {
        UnitQuaternion::new_unchecked(quaternion)
    } else {
        UnitQuaternion::from_quaternion(quaternion)
    }
}

/// Lines with something on them, numbered from 1.
fn content_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn parse_numbers<const N: usize>(fields: &str) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    let mut fields = fields.split_ascii_whitespace();
    for (index, number) in numbers.iter_mut().enumerate() {
        let field = fields.next().ok_or_else(|| format!("{index} numbers, must be {N}"))?;
        let value = field.parse().ok().filter(|value: &f64| value.is_finite());
        *number = value.ok_or_else(|| format!("{field:?} is no number"))?;
    }
    match fields.next() {
        None => Ok(numbers),
        Some(field) => Err(format!("{field:?} follows after {N} numbers")),
    }
}

/// Seconds with any number of decimals; exact to the nanosecond, which f64 would not be. Further decimals are cut.
fn parse_stamp(field: &str) -> Option<Stamp> {
    if field.contains(['e', 'E']) {
        let seconds: f64 = field.parse().ok()?;
        return (seconds.abs() < 9e9).then(|| Stamp::from_seconds(seconds));
    }
    let (negative, digits) = field.strip_prefix('-').map_or((false, field), |digits| (true, digits));
    let (whole, decimals) = digits.split_once('.').unwrap_or((digits, ""));
    let all_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty() || !all_digits(whole) || !all_digits(decimals) {
        return None;
    }
    let nanos: i64 = format!("{decimals:0<9.9}").parse().ok()?;
    let stamp = whole.parse::<i64>().ok()?.checked_mul(1_000_000_000)?.checked_add(nanos)?;
    Some(Stamp(if negative { -stamp } else { stamp }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// A bent path with stamps that f64 seconds cannot hold.
    fn path() -> Trajectory {
        let mut trajectory = Trajectory::default();
        for i in 0..200_i64 {
            let s = i as f64 * 0.1;
            let pose = Pose::new(Vector3::new(s.sin() * 40.0, s.cos() / 3.0, -1e-9 * s), Vector3::new(0.1 * s, s, -s));
            assert!(trajectory.push(Stamp(1_700_000_000_000_000_001 + i * 99_999_999), pose));
        }
        trajectory
    }

    #[test]
    fn tum_comes_back_to_the_bit() {
        let text = tum_from_trajectory(&path());
        assert!(text.starts_with("1700000000.000000001 "), "{}", &text[..40]);
        let back = trajectory_from_tum(&text).expect("parses");
        for ((stamp, pose), (stamp_back, pose_back)) in path().poses().iter().zip(back.poses()) {
            assert_eq!((stamp, pose.translation), (stamp_back, pose_back.translation));
            assert!((pose.rotation.coords - pose_back.rotation.coords).amax() < 3e-16);
        }
        assert_eq!(back.poses().len(), 200);
    }

    #[test]
    fn kitti_comes_back() {
        let back = poses_from_kitti(&kitti_from_trajectory(&path())).expect("parses");
        assert_eq!(back.len(), 200);
        for ((_, pose), pose_back) in path().poses().iter().zip(&back) {
            assert_eq!(pose.translation, pose_back.translation);
            assert!(pose.rotation.angle_to(&pose_back.rotation) < 1e-7);
        }
    }

    #[test]
    fn kitti_is_row_major() {
        // 90 degrees left: x forward becomes y.
        let [pose] = poses_from_kitti("0 -1 0 5\t1 0 0 6 0 0 1 7\n").expect("parses").try_into().expect("one");
        assert!((pose * nalgebra::Point3::new(1.0, 0.0, 0.0) - nalgebra::Point3::new(5.0, 7.0, 7.0)).norm() < 1e-15);
    }

    #[test]
    fn stamps_are_exact() {
        for (text, nanos) in [
            ("0", 0),
            ("12.5", 12_500_000_000),
            ("1700000000.123456789", 1_700_000_000_123_456_789),
            ("1700000000.1234567899", 1_700_000_000_123_456_789),
            ("-0.000000001", -1),
            ("1.5e3", 1_500_000_000_000),
        ] {
            assert_eq!(parse_stamp(text), Some(Stamp(nanos)), "{text}");
        }
        for text in ["", "-", ".5", "1.2.3", "nan", "0x1", "99999999999", "1e300", "1,5"] {
            assert_eq!(parse_stamp(text), None, "{text}");
        }
    }

    #[test]
    fn broken_lines_are_named() {
        for (text, line, rule) in [
            ("# comment\n\n1 0 0 0 0 0 0\n", 3, "6 numbers, must be 7"),
            ("1 0 0 0 0 0 0 1\n2 0 0 x 0 0 0 1\n", 2, "\"x\" is no number"),
            ("1 0 0 0 0 0 0 1 9\n", 1, "follows after 7"),
            ("1 0 0 0 0 0 0 2\n", 1, "has norm 2, must be 1"),
            ("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", 2, "before that of the line above"),
            ("now 0 0 0 0 0 0 1\n", 1, "no time in seconds"),
            ("1 0 0 inf 0 0 0 1\n", 1, "no number"),
        ] {
            let error = trajectory_from_tum(text).expect_err(text);
            assert_eq!(error.line, line, "{text:?}");
            assert!(error.rule.contains(rule), "{error}");
        }
        let mirrored = poses_from_kitti("-1 0 0 0 0 1 0 0 0 0 1 0\n").expect_err("is a mirror");
        assert!(mirrored.rule.contains("no rotation"));
    }

    #[test]
    fn the_reference_trajectories_of_a_real_drive_read() {
        // Path lengths as the data's notes give them.
        for (name, length_m) in [("kiss_icp_1.3.0", 16.91), ("small_gicp_f2f", 16.90)] {
            let Some(path) = real_data::real_data(&format!("kitti_raw_0048/ref_traj_{name}.txt")) else { return };
            let poses = poses_from_kitti(&std::fs::read_to_string(path).expect("reads")).expect("parses");
            let step = |pair: &[Pose]| (pair[1].translation.vector - pair[0].translation.vector).norm();
            let length: f64 = poses.windows(2).map(step).sum();
            assert_eq!(poses.len(), 22);
            assert!((length - length_m).abs() < 0.01, "{name}: {length} m");
        }
    }
}
