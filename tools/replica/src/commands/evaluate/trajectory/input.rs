//! Trajectories from wherever they are.

use super::{Args, Thing};
use anyhow::{Context, bail};
use formats::drive::{Drive, MANIFEST_FILE};
use formats::trajectory::TrajectoryFile;
use geometry::{Pose, Trajectory};
use scores::trajectory::{Alignment, Association, align, associate, associate_by_number};
use std::path::{Path, PathBuf};

/// What export calls the trajectory of a run.
const OF_A_RUN: &str = "trajectory.txt";
/// Poses without stamps follow each other at 10 Hz, as KITTI's do.
const PERIOD_NANOS: i64 = 100_000_000;

/// Both trajectories, pose by pose.
pub fn read(args: &Args) -> anyhow::Result<Association> {
    let truth = truth(args)?;
    let estimate = load(&args.estimate, args.times.as_deref())?;
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
            bail!("{}: poses without stamps\nhint: --truth-times", args.truth.display())
        }
        (_, TrajectoryFile::Numbered(_)) => bail!("{}: poses without stamps\nhint: --times", args.estimate.display()),
    }
}

/// The trajectory file of a run's folder, or the file itself.
fn file_of(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(OF_A_RUN) } else { path.to_owned() }
}

fn load(path: &Path, times: Option<&Path>) -> anyhow::Result<TrajectoryFile> {
    TrajectoryFile::load(&file_of(path), times).map_err(|problem| anyhow::anyhow!("{problem}"))
}

fn truth(args: &Args) -> anyhow::Result<TrajectoryFile> {
    if !args.truth.join(MANIFEST_FILE).is_file() {
        let is_given = args.of == Thing::Lidar;
        anyhow::ensure!(!is_given, "{}: --of lidar needs a drive, which says where the lidar is", args.truth.display());
        return load(&args.truth, args.truth_times.as_deref());
    }
    let drive = Drive::open(&args.truth)?;
    let truth = of_drive(&drive)?;
    Ok(TrajectoryFile::Stamped(match args.of {
        Thing::Body => truth,
        Thing::Lidar => moved(&truth, &drive.rig().body_from_lidar),
    }))
}

/// The truth of a drive.
pub fn of_drive(drive: &Drive) -> anyhow::Result<Trajectory> {
    let truth = drive.true_trajectory().with_context(|| format!("{}: has no truth", drive.folder().display()))?;
    truth.map_err(|problem| anyhow::anyhow!("{problem}"))
}

/// `truth_world_from_world` of a run: the least squares of its trajectory.
pub fn aligned_by_trajectory(truth: &Trajectory, run: &Path) -> anyhow::Result<Pose> {
    let TrajectoryFile::Stamped(estimate) = load(run, None)? else { bail!("{}: poses without stamps", run.display()) };
    // True poses are 10 ms apart; a run has one a sweep.
    let pairs = associate(truth, &estimate, PERIOD_NANOS, 0).pairs;
    let found = align(&pairs, Alignment::Se3).with_context(|| format!("{}: trajectory", run.display()))?;
    Ok(found.pose)
}

/// Of something that is mounted on the body.
fn moved(trajectory: &Trajectory, body_from_thing: &Pose) -> Trajectory {
    let mut moved = Trajectory::default();
    for (stamp, pose) in trajectory.poses() {
        moved.push(*stamp, pose * body_from_thing);
    }
    moved
}

fn shifted(trajectory: &Trajectory, nanos: i64) -> Trajectory {
    let mut shifted = Trajectory::default();
    for (stamp, pose) in trajectory.poses() {
        shifted.push(stamp.plus_nanos(nanos), *pose);
    }
    shifted
}
