//! Reads two trajectories and pairs their poses.

use anyhow::{Context, bail};
use clap::ValueEnum;
use drive::{Drive, MANIFEST_FILE};
use formats::trajectory::TrajectoryFile;
use geometry::{Pose, Trajectory};
use scores::trajectory::{Alignment, Association, align, associate, associate_by_number};
use std::path::{Path, PathBuf};

/// The trajectory file of a run, written by export.
pub const RUN_TRAJECTORY: &str = "trajectory.txt";
/// Poses without times are assumed to be at 10 Hz, as in KITTI.
const PERIOD_NANOS: i64 = 100_000_000;

/// The frame of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PoseFrame {
    /// The body frame of the vehicle.
    Body,
    /// The frame of the lidar.
    Lidar,
}

/// The trajectories to read, and how to pair them.
pub struct PoseInput<'a> {
    /// Drive folder, output folder of a run, or file.
    pub truth: &'a Path,
    /// Times of a KITTI file.
    pub truth_times: Option<&'a Path>,
    /// Output folder of a run, or file.
    pub estimate: &'a Path,
    /// Times of a KITTI file.
    pub estimate_times: Option<&'a Path>,
    /// Frame of the estimated poses.
    pub frame: PoseFrame,
    /// Added to the times of the estimate, ms.
    pub shift_ms: f64,
    /// Longest gap of the truth that is interpolated, ms.
    pub max_pause_ms: f64,
    /// Least time between poses of the estimate, ms.
    pub min_step_ms: f64,
}

/// Reads both trajectories and pairs their poses.
pub fn read(args: &PoseInput<'_>) -> anyhow::Result<Association> {
    let truth = truth(args)?;
    let estimate = load(args.estimate, args.estimate_times)?;
    let nanos = |ms: f64| (ms * 1e6).round() as i64;
    match (truth, estimate) {
        (TrajectoryFile::Stamped(truth), TrajectoryFile::Stamped(estimate)) => {
            let estimate = shifted(&estimate, nanos(args.shift_ms));
            Ok(associate(&truth, &estimate, nanos(args.max_pause_ms), nanos(args.min_step_ms)))
        }
        (TrajectoryFile::Numbered(truth), TrajectoryFile::Numbered(estimate)) => {
            Ok(associate_by_number(&truth, &estimate, PERIOD_NANOS))
        }
        (TrajectoryFile::Numbered(_), _) => {
            bail!("{}: poses without times\nhint: --truth-times FILE", args.truth.display())
        }
        (_, TrajectoryFile::Numbered(_)) => {
            bail!("{}: poses without times\nhint: --times FILE", args.estimate.display())
        }
    }
}

/// The file itself, or the trajectory file of a run's folder.
fn file_of(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(RUN_TRAJECTORY) } else { path.to_owned() }
}

fn load(path: &Path, times: Option<&Path>) -> anyhow::Result<TrajectoryFile> {
    TrajectoryFile::load(&file_of(path), times).map_err(|problem| anyhow::anyhow!("{problem}"))
}

fn truth(args: &PoseInput<'_>) -> anyhow::Result<TrajectoryFile> {
    if !args.truth.join(MANIFEST_FILE).is_file() {
        let needs_rig = args.frame == PoseFrame::Lidar;
        anyhow::ensure!(
            !needs_rig,
            "{}: --of lidar needs a drive folder, which contains the pose of the lidar",
            args.truth.display()
        );
        return load(args.truth, args.truth_times);
    }
    let drive = Drive::open(args.truth)?;
    let truth = true_trajectory(&drive)?;
    Ok(TrajectoryFile::Stamped(match args.frame {
        PoseFrame::Body => truth,
        PoseFrame::Lidar => in_frame(&truth, &drive.rig().body_from_lidar),
    }))
}

/// The true trajectory of a drive.
pub fn true_trajectory(drive: &Drive) -> anyhow::Result<Trajectory> {
    let truth = drive
        .true_trajectory()
        .with_context(|| format!("{}: the drive has no ground truth", drive.folder().display()))?;
    truth.map_err(|problem| anyhow::anyhow!("{problem}"))
}

/// `truth_world_from_world` of a run: the least-squares alignment of its trajectory.
pub fn alignment_by_trajectory(truth: &Trajectory, run: &Path) -> anyhow::Result<Pose> {
    let TrajectoryFile::Stamped(estimate) = load(run, None)? else { bail!("{}: poses without times", run.display()) };
    // True poses are 10 ms apart; a run has one pose per sweep.
    let pairs = associate(truth, &estimate, PERIOD_NANOS, 0).pairs;
    let found = align(&pairs, Alignment::Se3).with_context(|| format!("{}: trajectory", run.display()))?;
    Ok(found.pose)
}

/// The trajectory of a frame that is fixed to the body.
fn in_frame(trajectory: &Trajectory, body_from_frame: &Pose) -> Trajectory {
    let mut result = Trajectory::default();
    for (stamp, pose) in trajectory.poses() {
        result.push(*stamp, pose * body_from_frame);
    }
    result
}

fn shifted(trajectory: &Trajectory, nanos: i64) -> Trajectory {
    let mut shifted = Trajectory::default();
    for (stamp, pose) in trajectory.poses() {
        shifted.push(stamp.plus_nanos(nanos), *pose);
    }
    shifted
}
