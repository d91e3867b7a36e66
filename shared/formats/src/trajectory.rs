//! Trajectories as text: TUM, KITTI and CSV.
//!
//! Numbers are written with as many digits as it takes to read the same bits back. What is read must hold to these rules, and a
//! line that does not is named with what stands there: numbers are finite; stamps do not fall, and of equal ones the last
//! counts; a quaternion's norm, and a matrix times its transpose, are 1 to 0.001 and made exact. Empty lines and lines that
//! start with `#` are passed over.

mod csv;
mod file;
mod kitti;
mod line;
mod tum;

pub use csv::{csv_from_trajectory, trajectory_from_csv};
pub use file::{TrajectoryFile, numbered};
pub use kitti::{kitti_from_trajectory, poses_from_kitti, times_from_kitti, times_from_trajectory};
pub use tum::{trajectory_from_tum, tum_from_trajectory};

use geometry::{Pose, Stamp, Trajectory};

/// A line that is no pose.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("line {line}: {rule}")]
pub struct TrajectoryError {
    /// Counted from 1.
    pub line: usize,
    /// What was found and what is allowed.
    pub rule: String,
}

fn push(trajectory: &mut Trajectory, line: usize, stamp: Stamp, pose: Pose) -> Result<(), TrajectoryError> {
    if trajectory.push(stamp, pose) {
        return Ok(());
    }
    Err(TrajectoryError { line, rule: format!("time {stamp} is before that of the line above") })
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
    fn tum_and_csv_come_back_to_the_bit() {
        let text = tum_from_trajectory(&path());
        assert!(text.starts_with("1700000000.000000001 "), "{}", &text[..40]);
        let back = trajectory_from_tum(&text).expect("parses");
        for ((stamp, pose), (stamp_back, pose_back)) in path().poses().iter().zip(back.poses()) {
            assert_eq!((stamp, pose.translation), (stamp_back, pose_back.translation));
            assert!((pose.rotation.coords - pose_back.rotation.coords).amax() < 3e-16);
        }
        assert_eq!(back.poses().len(), 200);
        assert_eq!(trajectory_from_csv(&csv_from_trajectory(&path())), Ok(back));
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
