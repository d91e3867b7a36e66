//! `replica simulate`: a drive through a procedural town, with truth.

use anyhow::Context;
use clap::ValueEnum;
use formats::problems::{FileError, FileProblem};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use simulation::{CalibrationError, DriveReport, DriveSpec, RigSpec, Town, write_drive};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Makes a drive folder: what the sensors of a vehicle record on its way through a town, and the truth about it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Kind of town.
    #[arg(long, value_enum, default_value_t = TownName::Urban)]
    town: TownName,
    /// Seed of town, traffic and noise; equal seeds give equal bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Length of the drive, s (0.2 to 2400); about 12 MB per second.
    #[arg(long, default_value_t = 12.0)]
    seconds: f64,
    /// The vehicle: l3d2, survey, nuscenes, kitti, or a rig file (docs/simulation.md).
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "l3d2")]
    rig: String,
    /// How far sensors sit from where drive.toml says: standard deviations in deg (0 to 10) and cm (0 to 100).
    #[arg(long, value_name = "DEG,CM", default_value = "0,0", value_parser = calibration_error)]
    calibration_error: CalibrationError,
    /// Exposure of the mosaic cameras, ms (0.1 to 1000).
    #[arg(long, default_value_t = 5.0)]
    mosaic_exposure_ms: f64,
    /// Write truth/visibility, too: which cameras saw each return (docs/simulation.md). Takes as long as the rest.
    #[arg(long)]
    truth_visibility: bool,
    /// Folder to make; it must not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum TownName {
    /// Blocks of houses, squares and parks; a round of 1.5 km.
    Urban,
    /// Houses in gardens along curved roads; a round of 1.5 km.
    Suburban,
    /// A country road with village, fields, forest, tunnel, level crossing, canal and farms.
    Rural,
    /// The country road through open fields: next to nothing for an odometry to hold on to.
    Field,
    /// The country road through tunnels of 110 m and more; the drive begins before the first one.
    Tunnel,
}

impl From<TownName> for Town {
    fn from(name: TownName) -> Self {
        match name {
            TownName::Urban => Self::Urban,
            TownName::Suburban => Self::Suburban,
            TownName::Rural => Self::Rural,
            TownName::Field => Self::Field,
            TownName::Tunnel => Self::Tunnel,
        }
    }
}

/// Runs the command. What was made goes to stdout, the progress to stderr if that is a terminal.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let rig = match rig(&args.rig) {
        Ok(rig) => rig,
        Err(error) => {
            eprintln!("{error}");
            return Ok(ExitCode::from(stage::exit::CONFIGURATION));
        }
    };
    let spec = DriveSpec {
        town: args.town.into(),
        // A negative or absurd number becomes 0 or the largest, which the check names.
        mosaic_exposure_nanos: (args.mosaic_exposure_ms * 1e6).round() as u64,
        truth_visibility: args.truth_visibility,
        rig,
        calibration_error: args.calibration_error,
        ..DriveSpec::urban(args.seed, args.seconds)
    };
    let bar = progress_bar();
    let result = write_drive(&spec, &args.out, &mut |share| bar.set_position((share * STEPS as f64) as u64));
    bar.finish_and_clear();
    let report = result.context("simulate")?;
    print(&report, args).context("stdout")?;
    Ok(ExitCode::SUCCESS)
}

/// A built-in rig, or that of a file.
fn rig(name: &str) -> Result<RigSpec, FileError> {
    if let Some(rig) = RigSpec::built_in(name) {
        return Ok(rig);
    }
    let path = Path::new(name);
    let text = std::fs::read_to_string(path).map_err(|error| {
        let names: Vec<&str> = RigSpec::built_in_names().collect();
        FileProblem::of_file(path, format!("cannot be read: {error}; built in are {}", names.join(", ")))
    })?;
    RigSpec::from_toml(path, &text)
}

/// `DEG,CM`.
fn calibration_error(text: &str) -> Result<CalibrationError, String> {
    let numbers = text.split_once(',').and_then(|(deg, cm)| Some((deg.trim().parse().ok()?, cm.trim().parse().ok()?)));
    let (rotation_deg, cm): (f64, f64) = numbers.ok_or("must be two numbers DEG,CM")?;
    Ok(CalibrationError { rotation_deg, translation_m: cm * 0.01 })
}

/// Resolution of the progress.
const STEPS: u64 = 1000;

fn progress_bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
    // The template is a constant: without it the bar is plain, not wrong.
    match ProgressStyle::with_template("simulate [{wide_bar}] {percent} % {eta} left") {
        Ok(style) => bar.with_style(style.progress_chars("=> ")),
        Err(_) => bar,
    }
}

fn print(report: &DriveReport, args: &Args) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "{}: {} sweeps, {} returns, {} images, {} mosaics",
        args.out.display(),
        report.n_sweeps,
        report.n_returns,
        report.n_images,
        report.n_mosaics
    )?;
    for (class, share) in report.class_rates() {
        writeln!(out, "{:>14} {:6.2} %", class.name(), share * 100.0)?;
    }
    Ok(())
}
