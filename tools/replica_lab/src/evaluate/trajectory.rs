//! `replica-lab evaluate trajectory`: absolute and relative errors as defined by evo, errors over segments as defined by KITTI.

mod error_charts;
mod pose_input;
mod report;

use anyhow::{Context, ensure};
use clap::ValueEnum;
use command_line::answer::Answer;
use command_line::argument::{finite, not_negative, positive};
use command_line::exit_code;
use command_line::say_error;
use files::regular_file;
use formats::trajectory::{csv_from_trajectory, kitti_from_trajectory, times_from_trajectory, tum_from_trajectory};
use geometry::Trajectory;
use pictures::cost_history::CostHistory;
use pose_input::{PoseFrame, PoseInput};
pub use pose_input::{RUN_TRAJECTORY, alignment_by_trajectory, true_trajectory};
pub use report::Report;
use scores::trajectory::{
    AlignError, Alignment, Association, KITTI_LENGTHS_M, KITTI_STEP, PosePair, align, distances_along,
    intervals_by_count, intervals_by_distance, kitti_segments, relative_errors,
};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Score a trajectory: absolute and relative errors as in evo, errors over segments as in KITTI.
///
/// Both trajectories may be in KITTI, TUM or CSV format.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 no pose of the estimate has a true pose\n\n\
                  Example: replica-lab evaluate trajectory drives/sample out/sample --out scores")]
pub struct Args {
    /// Drive folder with ground truth, output folder of a run, or trajectory file
    truth: PathBuf,
    /// Output folder of a run, or trajectory file
    estimate: PathBuf,
    /// Alignment of the estimate to the truth
    #[arg(long, value_enum, default_value = "se3")]
    align: Align,
    /// Frame of the estimated poses; lidar converts the truth of a drive to that frame
    #[arg(long, value_enum, default_value = "body")]
    of: PoseFrame,
    /// Times of a truth in KITTI format: seconds, one per line
    #[arg(long, value_name = "FILE")]
    truth_times: Option<PathBuf>,
    /// Times of an estimate in KITTI format: seconds, one per line
    #[arg(long, value_name = "FILE")]
    times: Option<PathBuf>,
    /// Time to add to the times of the estimate, ms: for poses at another point of the sweep than the true poses
    #[arg(long, value_name = "MS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite)]
    shift_ms: f64,
    /// Interpolate the truth between poses up to this time apart, ms
    #[arg(long, value_name = "MS", default_value_t = 250.0, value_parser = not_negative)]
    max_pause_ms: f64,
    /// Ignore poses of the estimate that follow another within less than this, ms: a run's trajectory has poses at the end of a
    /// sweep and at the start of the next
    #[arg(long, value_name = "MS", default_value_t = 1.0, value_parser = not_negative)]
    min_step_ms: f64,
    /// Lengths of the segments, m; lengths above the length of the trajectory are ignored [default: 100,200,...,800]
    #[arg(long, value_name = "M,...", value_delimiter = ',', value_parser = positive)]
    segments: Vec<f64>,
    /// Start a segment at every N-th pose
    #[arg(long, value_name = "N", default_value_t = KITTI_STEP as u32, value_parser = clap::value_parser!(u32).range(1..))]
    segment_step: u32,
    /// Length of the intervals of relative errors, poses
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    rpe_poses: u32,
    /// Length of the intervals of relative errors, m along the estimate
    #[arg(long, value_name = "M", default_value_t = 10.0, value_parser = positive)]
    rpe_m: f64,
    /// Folder for evaluation.md, evaluation.json, poses.csv, segments.csv, trajectory.svg and errors.svg; for a run also
    /// costs.svg
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also write both trajectories into the folder, aligned and at the same times
    #[arg(long, value_enum, requires = "out")]
    write: Option<Format>,
    #[command(flatten)]
    answer: Answer,
}

/// Alignment of the estimate.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Align {
    /// No alignment.
    None,
    /// Make the first poses equal.
    First,
    /// Least squares, rotation and translation.
    Se3,
    /// Least squares, rotation, translation and scale.
    Sim3,
}

/// Format of a trajectory file.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// truth.txt, estimate.txt
    Tum,
    /// truth.txt, estimate.txt, times.txt
    Kitti,
    /// truth.csv, estimate.csv
    Csv,
}

/// Prints the tables and writes the files.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let Some(report) = evaluate(args)? else {
        say_error!(
            "no pose of {} has a true pose in {}\nhint: compare the times of both files; see --shift-ms and --max-pause-ms",
            args.estimate.display(),
            args.truth.display()
        );
        return Ok(ExitCode::from(exit_code::INCOMPLETE));
    };
    args.answer.print(&report.json(), || report.markdown())?;
    if let Some(out) = &args.out {
        write(out, &report, args)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn evaluate(args: &Args) -> anyhow::Result<Option<Report>> {
    let association = pose_input::read(&PoseInput {
        truth: &args.truth,
        truth_times: args.truth_times.as_deref(),
        estimate: &args.estimate,
        estimate_times: args.times.as_deref(),
        frame: args.of,
        shift_ms: args.shift_ms,
        max_pause_ms: args.max_pause_ms,
        min_step_ms: args.min_step_ms,
    })?;
    if association.pairs.is_empty() {
        return Ok(None);
    }
    let alignment = match args.align {
        Align::None => Alignment::None,
        Align::First => Alignment::First,
        Align::Se3 => Alignment::Se3,
        Align::Sim3 => Alignment::Sim3,
    };
    let intervals = Intervals {
        lengths_m: if args.segments.is_empty() { &KITTI_LENGTHS_M[..] } else { &args.segments },
        step: args.segment_step as usize,
        rpe_poses: args.rpe_poses,
        rpe_m: args.rpe_m,
    };
    let mut report = report(association, alignment, &intervals)?;
    let names = [("truth", args.truth.display().to_string()), ("estimate", args.estimate.display().to_string())];
    report.heading.splice(0..0, names);
    report.heading.extend(step_times(&args.estimate).map(|text| ("step of slam_aggregate", text)));
    Ok(Some(report))
}

/// The parts of a trajectory over which relative errors are computed.
struct Intervals<'a> {
    lengths_m: &'a [f64],
    step: usize,
    rpe_poses: u32,
    rpe_m: f64,
}

/// The scores of a run, with the default settings of the command. A straight path is aligned by its first pose.
pub fn report_of_run(association: Association) -> Result<Report, AlignError> {
    let intervals = Intervals { lengths_m: &KITTI_LENGTHS_M, step: KITTI_STEP, rpe_poses: 1, rpe_m: 10.0 };
    let is_straight = align(&association.pairs, Alignment::Se3) == Err(AlignError::OnALine);
    let alignment = if is_straight { Alignment::First } else { Alignment::Se3 };
    report(association, alignment, &intervals)
}

fn report(association: Association, alignment: Alignment, intervals: &Intervals<'_>) -> Result<Report, AlignError> {
    let unpaired = report::unpaired(&association);
    let mut pairs = association.pairs;
    let found = align(&pairs, alignment)?;
    found.apply(&mut pairs);
    let Intervals { lengths_m, step, rpe_poses, rpe_m } = *intervals;
    let plural = if rpe_poses == 1 { "" } else { "s" };
    let relative = [
        (format!("RPE, {rpe_poses} pose{plural}"), intervals_by_count(pairs.len(), rpe_poses as usize)),
        (format!("RPE, {rpe_m} m"), intervals_by_distance(&pairs, rpe_m)),
    ];
    let relative = relative.map(|(name, intervals)| (name, relative_errors(&pairs, &intervals)));
    let seconds = pairs[pairs.len() - 1].stamp.seconds_since(pairs[0].stamp);
    let length_m = distances_along(&pairs).last().copied().unwrap_or(0.0);
    let heading = vec![
        ("length of the truth", format!("{length_m:.2} m in {seconds:.2} s")),
        ("alignment", format!("{alignment:?}, scale {}", found.scale).to_lowercase()),
    ];
    let segments = kitti_segments(&pairs, lengths_m, step);
    Ok(Report { heading, unpaired, pairs, relative: relative.into(), segments })
}

/// Durations of the steps of `slam_aggregate`, if the estimate is a run with a summary.
fn step_times(run: &Path) -> Option<String> {
    let text = regular_file::read_to_string(run.join("summary.json")).ok()?;
    let summary: Value = serde_json::from_str(&text).ok()?;
    let stage = summary["stages"].as_array()?.iter().find(|stage| stage["name"] == "slam_aggregate")?;
    let ms = |name: &str| stage["step"][name].as_f64();
    let median = ms("p50_ms")?;
    let p99 = ms("p99_ms")?;
    let max = ms("max_ms")?;
    Some(format!("median {median:.1} ms, p99 {p99:.1} ms, max {max:.1} ms"))
}

fn write(out: &Path, report: &Report, args: &Args) -> anyhow::Result<()> {
    std::fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    ensure!(out.is_dir(), "{}: is not a folder", out.display());
    let write = |name: &str, text: String| {
        let path = out.join(name);
        std::fs::write(&path, text).with_context(|| path.display().to_string())
    };
    write("evaluation.md", report.markdown())?;
    write("evaluation.json", serde_json::to_string_pretty(&report.json())? + "\n")?;
    write("poses.csv", report.poses_csv())?;
    write("segments.csv", report.segments_csv())?;
    write("trajectory.svg", error_charts::map(report))?;
    write("errors.svg", error_charts::errors(report))?;
    if let Some(costs) = CostHistory::read(&args.estimate)? {
        write("costs.svg", costs.svg())?;
    }
    let Some(format) = args.write else { return Ok(()) };
    for name in ["truth", "estimate"] {
        let side = |pair: &PosePair| if name == "truth" { pair.truth } else { pair.estimate };
        let mut trajectory = Trajectory::default();
        for pair in &report.pairs {
            trajectory.push(pair.stamp, side(pair));
        }
        match format {
            Format::Tum => write(&format!("{name}.txt"), tum_from_trajectory(&trajectory))?,
            Format::Csv => write(&format!("{name}.csv"), csv_from_trajectory(&trajectory))?,
            Format::Kitti => {
                write(&format!("{name}.txt"), kitti_from_trajectory(&trajectory))?;
                write("times.txt", times_from_trajectory(&trajectory))?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod reference_tests;
