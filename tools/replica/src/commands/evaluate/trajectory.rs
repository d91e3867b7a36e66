//! `replica evaluate trajectory`: absolute errors, errors over poses and over a way as evo has them, over segments as KITTI has
//! them (docs/evaluation.md).

mod costs;
mod input;
mod plots;
mod report;

use anyhow::{Context, ensure};
use clap::ValueEnum;
use costs::Costs;
use formats::trajectory::{csv_from_trajectory, kitti_from_trajectory, times_from_trajectory, tum_from_trajectory};
use geometry::Trajectory;
pub use input::{aligned_by_trajectory, of_drive};
use report::Report;
use scores::trajectory::{
    Alignment, KITTI_LENGTHS_M, KITTI_STEP, PosePair, align, kitti_segments, pairs_by_count, pairs_by_way,
    relative_errors, ways,
};
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Exit code: no pose has a truth.
const NOTHING_PAIRED: u8 = 3;

/// Compares a trajectory with the truth: KITTI, TUM or CSV on either side.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// A drive folder with truth, the output folder of a run, or a trajectory file.
    truth: PathBuf,
    /// The output folder of a run, or a trajectory file.
    estimate: PathBuf,
    /// What puts the estimate into the world of the truth, before absolute errors.
    #[arg(long, value_enum, default_value = "se3")]
    align: Align,
    /// What the estimate's poses are of; `lidar` moves the truth of a drive there.
    #[arg(long, value_enum, default_value = "body")]
    of: Thing,
    /// Stamps of a KITTI truth: seconds, one a line.
    #[arg(long, value_name = "FILE")]
    truth_times: Option<PathBuf>,
    /// Stamps of a KITTI estimate: seconds, one a line.
    #[arg(long, value_name = "FILE")]
    times: Option<PathBuf>,
    /// Added to the estimate's stamps, ms: where poses hold at another instant of the sweep than the truth's.
    #[arg(long, value_name = "MS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite)]
    shift_ms: f64,
    /// The truth is interpolated between poses that are no more than this apart, ms.
    #[arg(long, value_name = "MS", default_value_t = 250.0, value_parser = not_negative)]
    max_pause_ms: f64,
    /// Poses of the estimate that follow the one before within less than this are passed over, ms: a run's trajectory has the
    /// last shot of a sweep and the first of the next.
    #[arg(long, value_name = "MS", default_value_t = 1.0, value_parser = not_negative)]
    min_step_ms: f64,
    /// Lengths of the segments, m; those that the way is too short for are left out [default: 100,200,...,800].
    #[arg(long, value_name = "M,...", value_delimiter = ',', value_parser = positive)]
    segments: Vec<f64>,
    /// Segments begin at every so many poses.
    #[arg(long, value_name = "N", default_value_t = KITTI_STEP as u32, value_parser = clap::value_parser!(u32).range(1..))]
    segment_step: u32,
    /// Poses of an interval of relative errors.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    rpe_poses: u32,
    /// Way of an interval of relative errors, m along the estimate.
    #[arg(long, value_name = "M", default_value_t = 10.0, value_parser = positive)]
    rpe_m: f64,
    /// Folder for evaluation.md and .json, poses.csv, segments.csv, trajectory.svg and errors.svg; costs.svg of a run.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Writes the pairs into the folder, too: truth and aligned estimate at the same stamps.
    #[arg(long, value_enum, requires = "out")]
    write: Option<Format>,
}

/// How the estimate is moved.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Align {
    /// Not at all.
    None,
    /// So that the first poses are equal.
    First,
    /// By the rotation and translation of the least squares.
    Se3,
    /// The same with a scale.
    Sim3,
}

/// What has a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Thing {
    /// The vehicle's body frame.
    Body,
    /// The lidar's frame.
    Lidar,
}

/// Of a trajectory file.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// truth.txt, estimate.txt
    Tum,
    /// truth.txt, estimate.txt, times.txt
    Kitti,
    /// truth.csv, estimate.csv
    Csv,
}

fn finite(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| "must be a number".to_owned())
}

fn not_negative(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|value| *value >= 0.0).ok_or_else(|| "must be 0 or more".to_owned())
}

fn positive(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|value| *value > 0.0).ok_or_else(|| "must be above 0".to_owned())
}

/// Prints the tables and writes the files; 3 if nothing can be paired.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let Some(report) = evaluate(args)? else {
        eprintln!(
            "no pose of {} has a truth in {}\nhint: compare the stamps; --shift-ms, --max-pause-ms",
            args.estimate.display(),
            args.truth.display()
        );
        return Ok(ExitCode::from(NOTHING_PAIRED));
    };
    // A reader that closes the pipe early has seen what it wanted.
    let _ = std::io::stdout().write_all(report.markdown().as_bytes());
    if let Some(out) = &args.out {
        write(out, &report, args)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn evaluate(args: &Args) -> anyhow::Result<Option<Report>> {
    let association = input::read(args)?;
    let left_out = report::left_out(&association);
    let mut pairs = association.pairs;
    if pairs.is_empty() {
        return Ok(None);
    }
    let alignment = match args.align {
        Align::None => Alignment::None,
        Align::First => Alignment::First,
        Align::Se3 => Alignment::Se3,
        Align::Sim3 => Alignment::Sim3,
    };
    let found = align(&pairs, alignment)?;
    found.apply(&mut pairs);
    let lengths = if args.segments.is_empty() { &KITTI_LENGTHS_M[..] } else { &args.segments };
    let plural = if args.rpe_poses == 1 { "" } else { "s" };
    let relative = [
        (format!("RPE, {} pose{plural}", args.rpe_poses), pairs_by_count(pairs.len(), args.rpe_poses as usize)),
        (format!("RPE, {} m", args.rpe_m), pairs_by_way(&pairs, args.rpe_m)),
    ];
    let relative = relative.map(|(name, intervals)| (name, relative_errors(&pairs, &intervals)));
    let seconds = pairs[pairs.len() - 1].stamp.seconds_since(pairs[0].stamp);
    let way_m = ways(&pairs).last().copied().unwrap_or(0.0);
    let mut heading = vec![
        ("truth", args.truth.display().to_string()),
        ("estimate", args.estimate.display().to_string()),
        ("way along the truth", format!("{way_m:.2} m in {seconds:.2} s")),
        ("aligned", format!("{alignment:?}, scale {}", found.scale).to_lowercase()),
    ];
    heading.extend(step_times(&args.estimate).map(|text| ("step of slam_aggregate", text)));
    let segments = kitti_segments(&pairs, lengths, args.segment_step as usize);
    Ok(Some(Report { heading, left_out, pairs, relative: relative.into(), segments }))
}

/// How long a sweep took, if the estimate is a run that says so.
fn step_times(run: &Path) -> Option<String> {
    let text = std::fs::read_to_string(run.join("summary.json")).ok()?;
    let summary: Value = serde_json::from_str(&text).ok()?;
    let stage = summary["stages"].as_array()?.iter().find(|stage| stage["name"] == "slam_aggregate")?;
    let ms = |name: &str| stage["step"][name].as_f64();
    let (median, p99, max) = (ms("p50_ms")?, ms("p99_ms")?, ms("max_ms")?);
    Some(format!("median {median:.1} ms, p99 {p99:.1} ms, at most {max:.1} ms"))
}

fn write(out: &Path, report: &Report, args: &Args) -> anyhow::Result<()> {
    std::fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    ensure!(out.is_dir(), "{}: is no folder", out.display());
    let write = |name: &str, text: String| {
        let path = out.join(name);
        std::fs::write(&path, text).with_context(|| path.display().to_string())
    };
    write("evaluation.md", report.markdown())?;
    write("evaluation.json", serde_json::to_string_pretty(&report.json())? + "\n")?;
    write("poses.csv", report.poses_csv())?;
    write("segments.csv", report.segments_csv())?;
    write("trajectory.svg", plots::map(report))?;
    write("errors.svg", plots::errors(report))?;
    if let Some(costs) = Costs::of_run(&args.estimate)? {
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
mod tests;
