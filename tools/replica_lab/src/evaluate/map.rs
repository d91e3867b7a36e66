//! `replica-lab evaluate map`: sharpness of clouds, and distance to a true cloud.

mod map_points;
mod report;

use super::trajectory::{alignment_by_trajectory, true_trajectory};
use anyhow::{Context, ensure};
use command_line::answer::Answer;
use command_line::argument::InvalidValue;
use drive::{Drive, MANIFEST_FILE};
use geometry::{Pose, Vector3};
use map_points::{LocalPoints, PointSelection};
use pictures::cloud_picture::render_top_view;
use report::MapReport;
use scores::map::{CrispnessSettings, DistanceSettings, PointIndex, crispness, distances};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Score clouds: thickness of facades, mean map entropy, distance to a true cloud.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab evaluate map out/sample --truth drives/sample --align")]
pub struct Args {
    /// PLY files, output folders of runs, or drives with ground truth, whose sweeps are placed by the true poses. Each is scored
    /// separately. Compare only clouds of the same sweeps
    #[arg(required = true, value_name = "CLOUD")]
    clouds: Vec<PathBuf>,
    /// True cloud: a PLY file, an output folder or a drive with ground truth
    #[arg(long, value_name = "CLOUD")]
    truth: Option<PathBuf>,
    /// Align the clouds of a run to the truth, which must be a drive, by least squares on the trajectories
    #[arg(long, requires = "truth")]
    align: bool,
    /// Ignore points that the run flagged as dynamic; no effect on drives
    #[arg(long)]
    static_only: bool,
    /// Radius of the neighborhoods for thickness and entropy, m (0.01 to 10)
    #[arg(long, value_name = "M", default_value_t = 0.3, value_parser = radius)]
    radius_m: f32,
    /// Largest number of points for which entropy and distances are computed
    #[arg(long, value_name = "N", default_value_t = 200_000, value_parser = clap::value_parser!(u32).range(1..))]
    samples: u32,
    /// Largest thickness of a facade, m
    #[arg(long, value_name = "M", default_value_t = 0.1)]
    max_thickness_m: f64,
    /// Points without a true point within this distance count as far, m (0.01 to 10)
    #[arg(long, value_name = "M", default_value_t = 1.0, value_parser = radius)]
    reach_m: f32,
    /// Folder for map.md, map.json and, for PLY files and runs, a top view of each
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    answer: Answer,
}

fn radius(text: &str) -> Result<f32, InvalidValue> {
    let value = text.parse().ok().filter(|value: &f32| (0.01..=10.0).contains(value));
    value.ok_or(InvalidValue("0.01 to 10"))
}

/// Prints the tables and writes the files.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let reports = evaluate(args)?;
    let scores = report::json(&reports);
    args.answer.print(&serde_json::json!({ "clouds": scores }), || report::markdown(&reports))?;
    let Some(out) = &args.out else { return Ok(ExitCode::SUCCESS) };
    std::fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    let write = |name: &str, text: String| {
        let path = out.join(name);
        std::fs::write(&path, text).with_context(|| path.display().to_string())
    };
    write("map.md", report::markdown(&reports))?;
    write("map.json", serde_json::to_string_pretty(&scores)? + "\n")?;
    for (number, cloud) in args.clouds.iter().enumerate().filter(|(_, cloud)| !is_drive(cloud)) {
        render_top_view(cloud, &out.join(format!("top_{number}.png")))?;
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
    let distance_settings = DistanceSettings { reach_m: args.reach_m, max_samples: args.samples as usize };
    // Drives have no flags of dynamic points.
    let static_only = |path: &Path| args.static_only && !is_drive(path);
    let truth: Option<(PointIndex, Vector3<f64>)> = match &args.truth {
        None => None,
        Some(path) => {
            let LocalPoints { points, origin } = map_points::read(
                path,
                &PointSelection {
                    static_only: static_only(path),
                    origin: None,
                    truth_world_from_world: Pose::identity(),
                },
            )?;
            Some((PointIndex::new(points, args.radius_m), origin))
        }
    };
    let mut reports = Vec::new();
    // One at a time: a cloud needs tens of bytes per point.
    for path in &args.clouds {
        let truth_world_from_world =
            if args.align { alignment(path, args.truth.as_deref())? } else { Pose::identity() };
        let origin = truth.as_ref().map(|(_, origin)| *origin);
        let selection = PointSelection { static_only: static_only(path), origin, truth_world_from_world };
        let LocalPoints { points, .. } = map_points::read(path, &selection)?;
        let index = PointIndex::new(points, args.radius_m);
        let crispness = crispness(&index, &settings);
        let distances = truth.as_ref().map(|(truth, _)| {
            [distances(&index, truth, &distance_settings), distances(truth, &index, &distance_settings)]
        });
        let name = path.display().to_string();
        let n_points = index.points().len();
        reports.push(MapReport { name, n_points, crispness, distances });
    }
    Ok(reports)
}

/// `truth_world_from_world` of a run.
fn alignment(run: &Path, truth: Option<&Path>) -> anyhow::Result<Pose> {
    let drive = truth.filter(|truth| is_drive(truth)).context("--align needs --truth DRIVE")?;
    if is_drive(run) {
        return Ok(Pose::identity());
    }
    ensure!(run.is_dir(), "{}: --align needs the output folder of a run, which contains the trajectory", run.display());
    alignment_by_trajectory(&true_trajectory(&Drive::open(drive)?)?, run)
}

#[cfg(test)]
mod wall_tests;
