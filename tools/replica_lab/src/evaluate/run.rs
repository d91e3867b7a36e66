//! `replica-lab evaluate OUT --truth DRIVE`: scores the finished clouds and the trajectory of a run against the recorded truth of its
//! drive, or its clouds against the labels of an imported recording.

mod deviations;
mod errors;
mod place;
mod point_scores;
mod pose_error;
mod report;

use super::recorded_truth::RecordedTruth;
use anyhow::{Context, bail, ensure};
use command_line::answer::Answer;
use command_line::argument::percent;
use command_line::exit_code;
use command_line::say_error;
use drive::{Drive, MANIFEST_FILE};
use files::regular_file;
use formats::ply::Vertices;
use messages::ClassId;
use pictures::cloud_files::cloud_files;
use point_scores::{PointScores, TrueLabels};
use report::RunReport;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// With a smaller share of points that are returns of the drive, the run belongs to another drive. If that drive has the same
/// LiDAR and times, only points where both scenes have the same range, such as the road, are also returns of this drive.
const MIN_SHARE_OF_DRIVE: f64 = 0.5;

/// Score a run: classes, instances, color, trajectory and the deviations that it states.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// Output folder of a run that has ended
    #[arg(value_name = "OUT")]
    run: PathBuf,
    /// Drive folder of this run, with ground truth: labels, a trajectory or both; or the imported recording (.mcap) that was replayed
    #[arg(long, value_name = "DRIVE")]
    truth: PathBuf,
    /// Classes whose instances are scored
    #[arg(long, value_delimiter = ',', default_value = "vehicles,pedestrian")]
    instances: Vec<ClassId>,
    /// True instances with fewer points, over all clouds, are ignored
    #[arg(long, value_name = "N", default_value_t = 100)]
    min_points: u64,
    /// Score ground (road, road line, sidewalk, ground, rail track, terrain) against all other classes
    #[arg(long)]
    ground: bool,
    /// Exit code 3 if a smaller share of the points is found among the returns of the drive, %. Points of sweeps without a label file
    /// do not count
    #[arg(long, value_name = "PERCENT", default_value_t = 99.0, value_parser = percent)]
    min_joined: f64,
    /// Folder for scores.md and scores.json
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object instead of text
    // Not flattened: clap leaves out optional arguments that have arguments of their own.
    #[arg(long)]
    json: bool,
}

/// Prints the scores and writes the files.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    ensure!(args.run.is_dir(), "{}: not the output folder of a run", args.run.display());
    if args.truth.extension().is_some_and(|extension| extension == "mcap") {
        let truth = TrueLabels::Recording(Box::new(RecordedTruth::open(&args.truth)?));
        return finish(args, Some(scored(args, truth)?), None);
    }
    ensure!(
        args.truth.join(MANIFEST_FILE).is_file(),
        "{}: no {MANIFEST_FILE}; --truth must be a drive folder with ground truth",
        args.truth.display()
    );
    let drive = Drive::open(&args.truth)?;
    let Some(truth) = &drive.manifest().truth else {
        bail!("{}: the drive has no ground truth: {MANIFEST_FILE} has no [truth]", args.truth.display())
    };
    let points =
        if truth.labels.is_some() { Some(scored(args, TrueLabels::from_drive(drive.clone())?)?) } else { None };
    let poses = errors::PoseScores::from_run(&drive, &args.run)?;
    finish(args, points, poses)
}

/// Prints the report and writes its files.
fn finish(args: &Args, points: Option<PointScores>, poses: Option<errors::PoseScores>) -> anyhow::Result<ExitCode> {
    let report = RunReport::new(&args.run, &args.truth, points, poses, &args.instances, args.min_points, args.ground);
    Answer::default().or(args.json).print(&report.json(), || report.markdown())?;
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out).with_context(|| out.display().to_string())?;
        let write = |name: &str, text: String| {
            let path = out.join(name);
            std::fs::write(&path, text).with_context(|| path.display().to_string())
        };
        write("scores.md", report.markdown())?;
        write("scores.json", serde_json::to_string_pretty(&report.json())? + "\n")?;
    }
    let Some(share) = report.share_joined().filter(|share| 100.0 * share < args.min_joined) else {
        return Ok(ExitCode::SUCCESS);
    };
    say_error!(
        "only {:.2} % of the points have a true label, less than --min-joined {} %",
        100.0 * share,
        args.min_joined
    );
    Ok(ExitCode::from(exit_code::INCOMPLETE))
}

/// Scores of the points of all clouds, one cloud in memory at a time. An error if the run belongs to another drive.
fn scored(args: &Args, truth: TrueLabels) -> anyhow::Result<PointScores> {
    let mut scores = PointScores::new(truth);
    for file in in_order(cloud_files(&args.run)?) {
        let cloud = Vertices::load(&file)?;
        scores.add(&cloud).with_context(|| file.display().to_string())?;
    }
    let n_points = scores.n_points;
    ensure!(n_points > 0, "{}: the clouds have no points", args.run.display());
    ensure!(
        scores.n_in_unlabeled < n_points,
        "{}: all points are of sweeps of {} that have no labels",
        args.run.display(),
        args.truth.display()
    );
    if scores.share_of_drive() < MIN_SHARE_OF_DRIVE {
        bail!(
            "{}: {}\nhint: --truth must be the drive of the run: {}",
            args.run.display(),
            scores.mismatch(&args.truth),
            drive_of(&args.run)
        );
    }
    Ok(scores)
}

/// Files in the order of the drive: submap 10000 follows submap 9999.
fn in_order(mut files: Vec<PathBuf>) -> Vec<PathBuf> {
    files.sort_by_cached_key(|file| (file.as_os_str().len(), file.clone()));
    files
}

/// The drive that the settings of a run name.
fn drive_of(run: &Path) -> String {
    let text = regular_file::read_to_string(run.join("run/launch.toml")).unwrap_or_default();
    let table: toml::Table = text.parse().unwrap_or_default();
    let drive = table.get("run").and_then(|run| run.get("drive")).and_then(toml::Value::as_str);
    drive.map_or_else(
        || "its launch file is not in the folder".to_owned(),
        |drive| format!("its launch file says {drive}"),
    )
}
