//! Trajectories as text: TUM, KITTI and CSV.
//!
//! Numbers are written with as many digits as needed to read back the same bits. Input must satisfy these rules:
//! - Numbers are finite.
//! - Stamps do not decrease. If stamps are equal, the last pose is used.
//! - Quaternions have norm 1, and rotation matrices are orthogonal, within 0.001. They are normalized.
//!
//! Empty lines and lines that start with `#` are skipped.

mod csv;
mod error;
mod file;
mod kitti;
mod line;
mod tum;

pub use csv::{csv_from_trajectory, trajectory_from_csv};
pub use error::{PoseFault, TrajectoryError};
pub use file::{TrajectoryFile, numbered};
pub use kitti::{kitti_from_trajectory, poses_from_kitti, times_from_kitti, times_from_trajectory};
pub use line::nanos_from_seconds;
pub use tum::{trajectory_from_tum, tum_from_trajectory};

use geometry::{Pose, Stamp, Trajectory};

fn push(trajectory: &mut Trajectory, line: usize, stamp: Stamp, pose: Pose) -> Result<(), TrajectoryError> {
    if trajectory.push(stamp, pose) {
        return Ok(());
    }
    Err(TrajectoryError { line, fault: PoseFault::TimeDecreases { stamp } })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// A curved path with stamps that f64 seconds cannot represent.
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
    fn tum_and_csv_survive_round_trip_bit_for_bit() {
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
    fn kitti_survives_round_trip() {
        let back = poses_from_kitti(&kitti_from_trajectory(&path())).expect("parses");
        assert_eq!(back.len(), 200);
        for ((_, pose), pose_back) in path().poses().iter().zip(&back) {
            assert_eq!(pose.translation, pose_back.translation);
            assert!(pose.rotation.angle_to(&pose_back.rotation) < 1e-7);
        }
    }

    #[test]
    fn invalid_lines_are_reported() {
        for (text, line, rule) in [
            ("# comment\n\n1 0 0 0 0 0 0\n", 3, "6 numbers, expected 7"),
            ("1 0 0 0 0 0 0 1\n2 0 0 x 0 0 0 1\n", 2, "\"x\" is not a finite number"),
            ("1 0 0 0 0 0 0 1 9\n", 1, "unexpected \"9\" after 7 numbers"),
            ("1 0 0 0 0 0 0 2\n", 1, "has norm 2, expected 1"),
            ("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", 2, "before the time of the previous line"),
            ("now 0 0 0 0 0 0 1\n", 1, "not a time in seconds"),
            ("1 0 0 inf 0 0 0 1\n", 1, "not a finite number"),
        ] {
            let error = trajectory_from_tum(text).expect_err(text);
            assert_eq!(error.line, line, "{text:?}");
            assert!(error.to_string().contains(rule), "{error}");
        }
    }

    #[real_data::test("kitti_raw_0048/ref_traj_kiss_icp_1.3.0.txt", "kitti_raw_0048/ref_traj_small_gicp_f2f.txt")]
    fn reference_trajectories_of_real_drive_have_their_documented_lengths() {
        for (name, length_m) in [("kiss_icp_1.3.0", 16.91), ("small_gicp_f2f", 16.90)] {
            let path = real_data::path(&format!("kitti_raw_0048/ref_traj_{name}.txt"));
            let poses = poses_from_kitti(&std::fs::read_to_string(path).expect("reads")).expect("parses");
            let step = |pair: &[Pose]| (pair[1].translation.vector - pair[0].translation.vector).norm();
            let length: f64 = poses.windows(2).map(step).sum();
            assert_eq!(poses.len(), 22);
            assert!((length - length_m).abs() < 0.01, "{name}: {length} m");
        }
    }
}
