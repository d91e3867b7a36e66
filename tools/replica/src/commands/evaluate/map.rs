//! `replica evaluate map`: how crisp a cloud is, and how far from the truth (docs/evaluation.md).

mod cloud;
mod report;

use crate::commands::evaluate::trajectory::{aligned_by_trajectory, of_drive};
use crate::commands::inspect;
use anyhow::{Context, ensure};
use cloud::{Choice, Points};
use formats::drive::{Drive, MANIFEST_FILE};
use geometry::{Pose, Vector3};
use report::MapReport;
use scores::map::{CrispnessSettings, DistanceSettings, PointIndex, crispness, distances};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Thickness of facades, mean map entropy, distance to a true cloud.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// PLY files, output folders of runs, or drives with truth, whose sweeps are placed by it. Each is a map of its own; compare
    /// only maps of the same sweeps.
    #[arg(required = true, value_name = "CLOUD")]
    clouds: Vec<PathBuf>,
    /// A cloud that is right: as above.
    #[arg(long, value_name = "CLOUD")]
    truth: Option<PathBuf>,
    /// Moves the clouds of a run into the world of the truth, a drive, as its trajectory fits best.
    #[arg(long, requires = "truth")]
    align: bool,
    /// Without the points that a run has flagged as moving; drives are taken whole.
    #[arg(long)]
    static_only: bool,
    /// Radius of the balls that thickness and entropy are taken in, m.
    #[arg(long, value_name = "M", default_value_t = 0.3, value_parser = radius)]
    radius_m: f32,
    /// Places that entropy and distances are taken at, at most.
    #[arg(long, value_name = "N", default_value_t = 200_000, value_parser = clap::value_parser!(u32).range(1..))]
    samples: u32,
    /// Facades are no thicker than this, m.
    #[arg(long, value_name = "M", default_value_t = 0.1)]
    max_thickness_m: f64,
    /// Points without one of the truth within this are far, m.
    #[arg(long, value_name = "M", default_value_t = 1.0, value_parser = radius)]
    reach_m: f32,
    /// Folder for map.md, map.json and, of PLY files and runs, a picture of each from above.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

fn radius(text: &str) -> Result<f32, String> {
    let value = text.parse().ok().filter(|value: &f32| (0.01..=10.0).contains(value));
    value.ok_or_else(|| "must be 0.01 to 10".to_owned())
}

/// Prints the tables and writes the files.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let reports = evaluate(args)?;
    // A reader that closes the pipe early has seen what it wanted.
    let _ = std::io::stdout().write_all(report::markdown(&reports).as_bytes());
    let Some(out) = &args.out else { return Ok(ExitCode::SUCCESS) };
    std::fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    let write = |name: &str, text: String| {
        let path = out.join(name);
        std::fs::write(&path, text).with_context(|| path.display().to_string())
    };
    write("map.md", report::markdown(&reports))?;
    write("map.json", serde_json::to_string_pretty(&report::json(&reports))? + "\n")?;
    for (number, cloud) in args.clouds.iter().enumerate().filter(|(_, cloud)| !is_drive(cloud)) {
        inspect::top_view(cloud, &out.join(format!("top_{number}.png")))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn is_drive(path: &Path) -> bool {
    path.join(MANIFEST_FILE).is_file()
}

fn evaluate(args: &Args) -> anyhow::Result<Vec<MapReport>> {
    let settings = CrispnessSettings {
        radius_m: args.radius_m,
        max_samples: args.samples as usize,
        max_thickness_m: args.max_thickness_m,
        ..CrispnessSettings::default()
    };
    let settings_of_distances = DistanceSettings { reach_m: args.reach_m, max_samples: args.samples as usize };
    // A drive has no flags.
    let static_only = |path: &Path| args.static_only && !is_drive(path);
    let truth: Option<(PointIndex, Vector3<f64>)> = match &args.truth {
        None => None,
        Some(path) => {
            let Points { points, origin } =
                cloud::read(path, &Choice { static_only: static_only(path), origin: None, moved: Pose::identity() })?;
            Some((PointIndex::new(points, args.radius_m), origin))
        }
    };
    let mut reports = Vec::new();
    // One after the other: a map takes tens of bytes a point.
    for path in &args.clouds {
        let moved = if args.align { alignment(path, args.truth.as_deref())? } else { Pose::identity() };
        let origin = truth.as_ref().map(|(_, origin)| *origin);
        let Points { points, .. } = cloud::read(path, &Choice { static_only: static_only(path), origin, moved })?;
        let index = PointIndex::new(points, args.radius_m);
        let crispness = crispness(&index, &settings);
        let distances = truth.as_ref().map(|(truth, _)| {
            [distances(&index, truth, &settings_of_distances), distances(truth, &index, &settings_of_distances)]
        });
        let (name, n_points) = (path.display().to_string(), index.points().len());
        reports.push(MapReport { name, n_points, crispness, distances });
    }
    Ok(reports)
}

/// `truth_world_from_world` of a run.
fn alignment(run: &Path, truth: Option<&Path>) -> anyhow::Result<Pose> {
    let drive = truth.filter(|truth| is_drive(truth)).context("--align: --truth must be a drive")?;
    if is_drive(run) {
        return Ok(Pose::identity());
    }
    ensure!(run.is_dir(), "{}: --align needs the output folder of a run, which has its trajectory", run.display());
    aligned_by_trajectory(&of_drive(&Drive::open(drive)?)?, run)
}

#[cfg(test)]
mod tests;
