//! `replica simulate`: a drive through a procedural town, with ground truth.

use anyhow::Context;
use clap::builder::{PossibleValue, PossibleValuesParser};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::de::IntoDeserializer;
use serde::de::value::Error as ValueError;
use simulation::{DriveReport, DriveSettings, SettingError, Town, write_drive};
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;

/// Simulates a drive: writes a drive folder with the recordings of all sensors of a vehicle and the ground truth.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[arg(long, help = meaning("town"), value_parser = town_names(), default_value_t = DriveSettings::default().town)]
    town: String,
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
        help = help("lidar_errors"),
        value_parser = |text: &str| name("lidar_errors", text),
        default_value_t = DriveSettings::default().lidar_errors,
    )]
    lidar_errors: String,
    #[arg(long, help = help("unit_seed"), default_value_t = DriveSettings::default().unit_seed)]
    unit_seed: u64,
    #[arg(
        long,
        help = help("traffic"),
        value_parser = |text: &str| name("traffic", text),
        default_value_t = DriveSettings::default().traffic,
    )]
    traffic: String,
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
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Standard deviations of the mounting errors.
#[derive(Clone, Copy, Debug)]
struct CalibrationErrors {
    deg: f64,
    cm: f64,
}

/// Runs the command. The report goes to stdout, the progress to stderr if that is a terminal.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let settings = DriveSettings {
        town: args.town.clone(),
        seed: args.seed,
        seconds: args.seconds,
        rig: args.rig.clone(),
        calibration_error_deg: args.calibration_error.deg,
        calibration_error_cm: args.calibration_error.cm,
        lidar_errors: args.lidar_errors.clone(),
        unit_seed: args.unit_seed,
        traffic: args.traffic.clone(),
        mosaic_exposure_ms: args.mosaic_exposure_ms,
        truth_visibility: args.truth_visibility,
    };
    let spec = match settings.spec() {
        Ok(spec) => spec,
        Err(error) => {
            eprintln!("{error}");
            return Ok(ExitCode::from(run::exit::CONFIGURATION));
        }
    };
    let bar = progress_bar();
    let result = write_drive(&spec, &args.out, &mut |share| bar.set_position((share * STEPS as f64) as u64));
    bar.finish_and_clear();
    let report = result.context("simulate")?;
    print(&report, args).context("stdout")?;
    Ok(ExitCode::SUCCESS)
}

/// Meaning of a setting.
fn meaning(key: &str) -> &'static str {
    DriveSettings::fields().into_iter().find(|field| field.key == key).map_or("", |field| field.meaning)
}

/// Meaning and rule of a setting.
fn help(key: &str) -> String {
    let rule = DriveSettings::fields().into_iter().find(|field| field.key == key).map(|field| field.rule);
    match rule {
        Some(rule) if !rule.is_empty() => format!("{} The value {rule}.", meaning(key)),
        _ => meaning(key).to_owned(),
    }
}

fn town_names() -> PossibleValuesParser {
    PossibleValuesParser::new(Town::ALL.map(|town| PossibleValue::new(town.name()).help(town.description())))
}

/// Parses a number and checks it by the rule of the setting `key`.
fn number(key: &str, text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "must be a number".to_owned())?;
    checked(key, DriveSettings::default().set(key, IntoDeserializer::<ValueError>::into_deserializer(value)))?;
    Ok(value)
}

/// Checks a name by the rule of the setting `key`.
fn name(key: &str, text: &str) -> Result<String, String> {
    checked(key, DriveSettings::default().set(key, IntoDeserializer::<ValueError>::into_deserializer(text)))?;
    Ok(text.to_owned())
}

fn checked(key: &str, result: Option<Result<(), SettingError>>) -> Result<(), String> {
    match result {
        Some(result) => result.map_err(|error| SettingError::text(&error)),
        None => Err(format!("{key} is not a setting")),
    }
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
