//! A trajectory file of any format.

use super::{TrajectoryError, line, poses_from_kitti, times_from_kitti, trajectory_from_csv, trajectory_from_tum};
use files::problems::FileProblem;
use files::regular_file;
use geometry::{Pose, Stamp, Trajectory};
use std::path::Path;

/// Content of a trajectory file.
#[derive(Clone, Debug, PartialEq)]
pub enum TrajectoryFile {
    /// Poses with stamps.
    Stamped(Trajectory),
    /// Poses of a KITTI file without times.
    Numbered(Vec<Pose>),
}

impl TrajectoryFile {
    /// Reads KITTI, TUM or CSV. The first line determines the format: twelve numbers are KITTI, a comma is CSV, everything else
    /// is TUM. `times` is the file with the stamps of a KITTI file, one for each pose.
    pub fn load(path: &Path, times: Option<&Path>) -> Result<Self, FileProblem> {
        let text = read(path)?;
        let fault = |error: TrajectoryError| problem(path, &error);
        let first = line::content_lines(&text).next().map_or("", |(_, line)| line);
        if first.split_ascii_whitespace().count() == 12 && !first.contains(',') {
            let poses = poses_from_kitti(&text).map_err(fault)?;
            return match times {
                None => Ok(Self::Numbered(poses)),
                Some(times) => with_times(&poses, path, times),
            };
        }
        if let Some(times) = times {
            let rule = format!("the file has stamps; {} is for KITTI files without stamps", times.display());
            return Err(FileProblem::for_file(path, rule));
        }
        if first.is_empty() {
            return Err(FileProblem::for_file(path, "the file contains no poses"));
        }
        let is_csv = first.contains(',');
        let trajectory = if is_csv { trajectory_from_csv(&text) } else { trajectory_from_tum(&text) };
        trajectory.map(Self::Stamped).map_err(fault)
    }
}

fn with_times(poses: &[Pose], path: &Path, times: &Path) -> Result<TrajectoryFile, FileProblem> {
    let stamps = times_from_kitti(&read(times)?).map_err(|error| problem(times, &error))?;
    if stamps.len() != poses.len() {
        let rule = format!("{} times for the {} poses of {}", stamps.len(), poses.len(), path.display());
        return Err(FileProblem::for_file(times, rule));
    }
    let mut trajectory = Trajectory::default();
    for (stamp, pose) in stamps.into_iter().zip(poses) {
        trajectory.push(stamp, *pose);
    }
    Ok(TrajectoryFile::Stamped(trajectory))
}

/// A trajectory of poses without stamps: pose 0 at 0 s, then one pose every `period_nanos`.
pub fn numbered(poses: &[Pose], period_nanos: i64) -> Trajectory {
    let mut trajectory = Trajectory::default();
    for (number, pose) in (0..).zip(poses) {
        trajectory.push(Stamp(number * period_nanos), *pose);
    }
    trajectory
}

fn read(path: &Path) -> Result<String, FileProblem> {
    regular_file::read_to_string(path)
        .map_err(|error| FileProblem::for_file(path, format!("cannot read the file: {error}")))
}

fn problem(path: &Path, error: &TrajectoryError) -> FileProblem {
    FileProblem { line: Some(error.line), ..FileProblem::for_file(path, error.fault.to_string()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{csv_from_trajectory, kitti_from_trajectory, times_from_trajectory, tum_from_trajectory};

    fn path() -> Trajectory {
        let poses: Vec<Pose> = (0..5).map(|i| Pose::translation(f64::from(i), 0.5, 0.0)).collect();
        numbered(&poses, 100_000_001)
    }

    #[test]
    fn format_is_detected_from_the_content() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| {
            let file = folder.path().join(name);
            std::fs::write(&file, text).expect("writes");
            file
        };
        let tum = write("a.txt", &format!("# by somebody\n{}", tum_from_trajectory(&path())));
        let csv = write("b.txt", &csv_from_trajectory(&path()));
        let kitti = write("c.txt", &kitti_from_trajectory(&path()));
        let times = write("times.txt", &times_from_trajectory(&path()));
        let stamped = TrajectoryFile::Stamped(path());
        assert_eq!(TrajectoryFile::load(&tum, None), Ok(stamped.clone()));
        assert_eq!(TrajectoryFile::load(&csv, None), Ok(stamped.clone()));
        assert_eq!(TrajectoryFile::load(&kitti, Some(&times)), Ok(stamped));
        let poses = path().poses().iter().map(|(_, pose)| *pose).collect();
        assert_eq!(TrajectoryFile::load(&kitti, None), Ok(TrajectoryFile::Numbered(poses)));

        let error = TrajectoryFile::load(&tum, Some(&times)).expect_err("has times").to_string();
        assert!(error.contains("a.txt: the file has stamps"), "{error}");
        let short = write("short.txt", "0\n1\n");
        let error = TrajectoryFile::load(&kitti, Some(&short)).expect_err("too few").to_string();
        assert!(error.contains("short.txt: 2 times for the 5 poses of"), "{error}");
        let broken = write("broken.txt", "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 2\n");
        let error = TrajectoryFile::load(&broken, None).expect_err("is broken").to_string();
        assert!(error.contains("broken.txt:2: quaternion 0 0 0 2 has norm 2, expected 1"), "{error}");
    }
}
