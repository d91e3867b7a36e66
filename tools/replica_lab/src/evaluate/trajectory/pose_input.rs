//! Reads two trajectories and pairs their poses.

use anyhow::{Context, bail};
use clap::ValueEnum;
use drive::manifest::{TrajectoryEntry, TrajectoryFormat};
use drive::{Drive, MANIFEST_FILE};
use formats::trajectory::TrajectoryFile;
use geometry::{Geodetic, Pose, Stamp, Trajectory};
use given_path::GivenPath;
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
    // An SBET has no week: it is taken from the other trajectory.
    let (truth, estimate) = if is_sbet(args.truth) {
        let near = if is_sbet(args.estimate) { None } else { start(&load(args.estimate, args.estimate_times)?) };
        let estimate = load_near(args.estimate, args.estimate_times, near, None)?;
        (load_near(args.truth, None, near, None)?, estimate)
    } else {
        let truth = truth(args)?;
        let near = start(&truth);
        let origin = origin_of(args.truth)?;
        (truth, load_near(args.estimate, args.estimate_times, near, origin)?)
    };
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

/// Whether a file is SBET, by its name.
fn is_sbet(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let ends = |end: &str| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(end));
    ends("sbet") || name.contains("sbet") && ends("out")
}

/// Time of the first pose.
fn start(file: &TrajectoryFile) -> Option<Stamp> {
    match file {
        TrajectoryFile::Stamped(trajectory) => trajectory.poses().first().map(|(stamp, _)| *stamp),
        TrajectoryFile::Numbered(_) => None,
    }
}

/// Origin of the world of a drive.
fn origin_of(truth: &Path) -> anyhow::Result<Option<Geodetic>> {
    if !truth.join(MANIFEST_FILE).is_file() {
        return Ok(None);
    }
    let drive = Drive::open(truth)?;
    let origin = drive.manifest().gnss.as_ref().map(|gnss| gnss.origin);
    Ok(origin.and_then(|[latitude, longitude, height]| Geodetic::new(latitude, longitude, height)))
}

/// Reads a file of any format; an SBET in the week of `near`, in east, north and up at `origin` or at its first pose.
fn load_near(
    path: &Path,
    times: Option<&Path>,
    near: Option<Stamp>,
    origin: Option<Geodetic>,
) -> anyhow::Result<TrajectoryFile> {
    if !is_sbet(path) {
        return load(path, times);
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut entry = TrajectoryEntry::new(&name, TrajectoryFormat::Sbet);
    // Two SBET files are compared within any week.
    entry.gps_week = near.is_none().then_some(0);
    let path = GivenPath::read(folder, &entry, near, origin).map_err(|problem| anyhow::anyhow!("{problem}"))?;
    Ok(TrajectoryFile::Stamped(path.trajectory().as_ref().clone()))
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

#[cfg(test)]
mod tests {
    use super::*;
    use formats::sbet::SbetRecord;
    use formats::trajectory::tum_from_trajectory;
    use geometry::{Isometry3, LocalFrame, Point3};

    #[test]
    fn sbet_equals_the_same_path_in_east_north_up_in_the_week_of_the_other_file() {
        // 2024-09-14, 18 s before midnight UTC: the week 2331 ends during the path.
        let start = Stamp(1_726_358_381_000_000_000);
        let frame = LocalFrame::new(Geodetic::new(48.85, 2.35, 60.0).expect("a place"));
        let mut path = Trajectory::default();
        let mut sbet = Vec::new();
        for k in 0..20 {
            let x = 0.7 * f64::from(k);
            let place = frame.geodetic_from_world(&Point3::new(x, 0.0, 0.0));
            path.push(start.plus_nanos(i64::from(k) * 100_000_000), Isometry3::translation(x, 0.0, 0.0));
            let record = SbetRecord {
                time_s: (604_799.0 + 0.1 * f64::from(k)).rem_euclid(604_800.0),
                latitude_rad: place.latitude_deg.to_radians(),
                longitude_rad: place.longitude_deg.to_radians(),
                altitude_m: place.altitude_m,
                // East.
                platform_heading_rad: std::f64::consts::FRAC_PI_2,
                ..SbetRecord::default()
            };
            sbet.extend(record.to_bytes());
        }
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [tum_file, sbet_file] = ["path.txt", "Path.SBET"].map(|name| folder.path().join(name));
        std::fs::write(&tum_file, tum_from_trajectory(&path)).expect("writes");
        std::fs::write(&sbet_file, sbet).expect("writes");
        for [truth, estimate] in [[&tum_file, &sbet_file], [&sbet_file, &tum_file], [&sbet_file, &sbet_file]] {
            let input = PoseInput {
                truth,
                truth_times: None,
                estimate,
                estimate_times: None,
                frame: PoseFrame::Body,
                shift_ms: 0.0,
                max_pause_ms: 150.0,
                min_step_ms: 0.0,
            };
            let found = read(&input).expect("reads");
            assert!(found.pairs.len() >= 19, "{} pairs", found.pairs.len());
            for pair in &found.pairs {
                let by = pair.truth.inverse() * pair.estimate;
                assert!(by.translation.vector.norm() < 1e-3 && by.rotation.angle() < 1e-5, "{by}");
            }
        }
    }
}
