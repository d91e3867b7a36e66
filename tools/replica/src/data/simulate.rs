//! `replica simulate`: a drive through a procedural town, with ground truth.

mod describe;

use anyhow::Context;
use command_line::argument::words;
use command_line::say_error;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use settings::{Field, Settings, parse_table};
use simulation::{ClassRate, DriveReport, DriveSettings, LidarGrade, Town, Traffic, write_drive};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use toml::de::DeTable;

/// Simulate a drive: write a drive folder with the recordings of all sensors of a vehicle and the ground truth.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage, 78 invalid rig or settings\n\n\
                  Example: replica simulate --town suburban --seconds 30 --out drives/suburban")]
pub struct Args {
    #[arg(long, help = meaning("town"), value_parser = words::<Town>(), default_value_t = DriveSettings::default().town)]
    town: Town,
    #[arg(long, help = help("seed"), default_value_t = DriveSettings::default().seed)]
    seed: u64,
    #[arg(
        long,
        help = help("seconds"),
        default_value_t = DriveSettings::default().seconds,
        value_parser = |text: &str| number("seconds", text),
    )]
    seconds: f64,
    #[arg(long, help = help("rig"), value_name = "NAME|FILE.toml", default_value_t = DriveSettings::default().rig)]
    rig: String,
    #[arg(
        long,
        help = format!("{}\n{}", help("calibration_error_deg"), help("calibration_error_cm")),
        value_name = "DEG,CM",
        default_value = "0,0",
        value_parser = calibration_error,
    )]
    calibration_error: CalibrationErrors,
    #[arg(
        long,
        help = meaning("lidar_errors"),
        value_parser = words::<LidarGrade>(),
        default_value_t = DriveSettings::default().lidar_errors,
    )]
    lidar_errors: LidarGrade,
    #[arg(long, help = help("pass"), default_value_t = DriveSettings::default().pass)]
    pass: u64,
    #[arg(long, help = help("unit_seed"), default_value_t = DriveSettings::default().unit_seed)]
    unit_seed: u64,
    #[arg(
        long,
        help = meaning("traffic"),
        value_parser = words::<Traffic>(),
        default_value_t = DriveSettings::default().traffic,
    )]
    traffic: Traffic,
    #[arg(
        long,
        help = help("mosaic_exposure_ms"),
        default_value_t = DriveSettings::default().mosaic_exposure_ms,
        value_parser = |text: &str| number("mosaic_exposure_ms", text),
    )]
    mosaic_exposure_ms: f64,
    #[arg(long, help = help("truth_visibility"))]
    truth_visibility: bool,
    /// Output folder; it must not exist. A drive takes about 12 MB per second.
    #[arg(long, value_name = "DIR", required_unless_present = "describe")]
    out: Option<PathBuf>,
    /// Print the settings of [simulate] as JSON instead of simulating; with REQUEST, also the problems of a launch file's table
    #[arg(long, value_name = "REQUEST", num_args = 0..=1, default_missing_value = describe::NO_REQUEST)]
    describe: Option<String>,
}

/// Standard deviations of the mounting errors.
#[derive(Clone, Copy, Debug)]
struct CalibrationErrors {
    deg: f64,
    cm: f64,
}

/// Runs the command. The report goes to stdout, the progress to stderr if that is a terminal.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match (&args.describe, &args.out) {
        (Some(request), _) => describe::run(request),
        (None, Some(out)) => simulate(args, out),
        // The command line requires one of them.
        (None, None) => anyhow::bail!("--out is missing"),
    }
}

fn simulate(args: &Args, out: &Path) -> anyhow::Result<ExitCode> {
    let settings = DriveSettings {
        town: args.town,
        seed: args.seed,
        pass: args.pass,
        seconds: args.seconds,
        rig: args.rig.clone(),
        calibration_error_deg: args.calibration_error.deg,
        calibration_error_cm: args.calibration_error.cm,
        lidar_errors: args.lidar_errors,
        unit_seed: args.unit_seed,
        traffic: args.traffic,
        mosaic_exposure_ms: args.mosaic_exposure_ms,
        truth_visibility: args.truth_visibility,
    };
    let spec = match settings.spec() {
        Ok(spec) => spec,
        Err(error) => {
            say_error!("{error}");
            return Ok(ExitCode::from(run::exit::CONFIGURATION));
        }
    };
    let bar = progress_bar();
    let result = write_drive(&spec, out, &mut |share| bar.set_position((share * STEPS as f64) as u64));
    bar.finish_and_clear();
    let report = result.context("simulate")?;
    print(&report, out).context("stdout")?;
    Ok(ExitCode::SUCCESS)
}

fn field(key: &str) -> Option<Field> {
    DriveSettings::fields().into_iter().find(|field| field.key == key)
}

/// Meaning of a setting.
fn meaning(key: &str) -> String {
    field(key).map_or_else(String::new, |field| field.meaning)
}

/// Meaning and rule of a setting.
fn help(key: &str) -> String {
    match field(key) {
        Some(field) if !field.rule.is_empty() => format!("{} The value {}.", field.meaning, field.rule),
        _ => meaning(key),
    }
}

/// Parses a number and checks it by the rule of the setting `key`.
fn number(key: &str, text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "must be a number".to_owned())?;
    let table = format!("{key} = {value:?}");
    let table = DeTable::parse(&table).map_err(|_| "must be a number".to_owned())?;
    let (_, problems) = parse_table::<DriveSettings>(table.get_ref());
    problems.into_iter().next().map_or(Ok(value), |problem| Err(problem.text))
}

/// Parses `DEG,CM`.
fn calibration_error(text: &str) -> Result<CalibrationErrors, String> {
    let (deg, cm) = text.split_once(',').ok_or("must be two numbers DEG,CM")?;
    Ok(CalibrationErrors {
        deg: number("calibration_error_deg", deg.trim())?,
        cm: number("calibration_error_cm", cm.trim())?,
    })
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

fn print(report: &DriveReport, folder: &Path) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "{}: {} sweeps, {} returns, {} images, {} mosaics",
        folder.display(),
        report.n_sweeps,
        report.n_returns,
        report.n_images,
        report.n_mosaics
    )?;
    for ClassRate { class, share } in report.class_rates() {
        writeln!(out, "{:>14} {:6.2} %", class.name(), share * 100.0)?;
    }
    Ok(())
}
