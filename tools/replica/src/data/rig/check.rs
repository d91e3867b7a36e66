//! `replica rig check`: whether a rig fits the data of its drive.

use super::PartOfDrive;
use command_line::answer::Answer;
use command_line::exit_code;
use drive::Drive;
use rig::check::{Report, Verdict};
use rig::picture;
use rig::survey::{SensorStamps, Survey};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Check whether drive.toml fits the recorded data, and suggest changes.
///
/// The motion is measured by the LiDAR alone. Cameras are compared with the outlines of objects, the other sensors with the motion.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 fits, 1 failed, 2 wrong usage, 3 doubts\n\n\
                  Example: replica rig check drives/mine --pictures pictures")]
pub struct Args {
    #[command(flatten)]
    part: PartOfDrive,
    /// Folder for pictures of points over images, of sweeps over each other and of yaw rates, and for the page rig.html
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
    #[command(flatten)]
    answer: Answer,
}

/// Result of the check.
#[derive(Serialize)]
struct Found<'a> {
    sensors: Vec<Sensor<'a>>,
    verdicts: &'a [Verdict],
    n_doubts: usize,
    /// The page with the pictures.
    pictures: Option<PathBuf>,
    n_pictures: usize,
}

/// The stamps of a sensor.
#[derive(Serialize)]
struct Sensor<'a> {
    name: &'a str,
    n: usize,
    /// First stamp, s since the Unix epoch.
    first: Option<String>,
    last: Option<String>,
    interval_s: f64,
    gap_s: f64,
}

impl<'a> Sensor<'a> {
    fn from_stamps(SensorStamps { name, n, span, interval_s, gap_s, .. }: &'a SensorStamps) -> Self {
        let [first, last] = span.map_or([None, None], |span| span.map(|stamp| Some(stamp.to_string())));
        Self { name, n: *n, first, last, interval_s: *interval_s, gap_s: *gap_s }
    }
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let drive = Drive::open(&args.part.drive)?;
    let settings = args.part.settings();
    let survey = Survey::from_drive(&drive, &settings)?;
    let report = Report::from_survey(&drive, &survey, &settings)?;
    let n_pictures = match &args.pictures {
        Some(folder) => picture::write(folder, &drive, &survey, &report)?,
        None => 0,
    };
    let found = Found {
        sensors: survey.stamps.iter().map(Sensor::from_stamps).collect(),
        verdicts: &report.verdicts,
        n_doubts: report.doubts().count(),
        pictures: args.pictures.as_ref().map(|folder| folder.join("rig.html")),
        n_pictures,
    };
    args.answer.print(&found, || found.text())?;
    Ok(if found.n_doubts == 0 { ExitCode::SUCCESS } else { ExitCode::from(exit_code::INCOMPLETE) })
}

impl Found<'_> {
    fn text(&self) -> String {
        let mut text = format!(
            "{:<16} {:>8} {:>22} {:>22} {:>10} {:>8}\n",
            "sensor", "number", "first", "last", "interval s", "gap s"
        );
        // Writing to a string cannot fail.
        for Sensor { name, n, first, last, interval_s, gap_s } in &self.sensors {
            let [first, last] = [first, last].map(|stamp| stamp.as_deref().unwrap_or("-"));
            let _ = writeln!(text, "{name:<16} {n:>8} {first:>22} {last:>22} {interval_s:>10.4} {gap_s:>8.3}");
        }
        text.push('\n');
        for verdict in self.verdicts {
            let _ = writeln!(text, "{verdict}");
        }
        if let Some(page) = &self.pictures {
            let _ = writeln!(text, "\n{} pictures: {}", self.n_pictures, page.display());
        }
        let _ = writeln!(text, "\n{} doubts", self.n_doubts);
        text
    }
}
