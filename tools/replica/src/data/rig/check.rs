//! `replica rig check`: whether a rig fits the data of its drive.

use super::PartOfDrive;
use crate::exit_code;
use crate::terminal::say;
use formats::drive::Drive;
use rig::check::Report;
use rig::picture;
use rig::survey::Survey;
use std::path::PathBuf;
use std::process::ExitCode;

/// Check whether drive.toml fits the recorded data, and say what to change.
///
/// The motion is measured by the LiDAR alone. Cameras are compared with the outlines of objects, the other sensors with the motion.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 fits, 1 failed, 2 wrong usage, 3 doubts")]
pub struct Args {
    #[command(flatten)]
    part: PartOfDrive,
    /// Folder for pictures of points over images, of sweeps over each other and of yaw rates, and for the page rig.html
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let drive = Drive::open(&args.part.drive)?;
    let settings = args.part.settings();
    let survey = Survey::of(&drive, &settings)?;
    let report = Report::of(&drive, &survey, &settings)?;
    say!("{:<16} {:>8} {:>22} {:>22} {:>10} {:>8}", "sensor", "number", "first", "last", "interval s", "gap s")?;
    for sensor in &survey.stamps {
        let [first, last] =
            sensor.span.map_or(["-".to_owned(), "-".to_owned()], |span| span.map(|stamp| stamp.to_string()));
        say!(
            "{:<16} {:>8} {first:>22} {last:>22} {:>10.4} {:>8.3}",
            sensor.name,
            sensor.n,
            sensor.interval_s,
            sensor.gap_s
        )?;
    }
    say!("")?;
    for verdict in &report.verdicts {
        say!("{verdict}")?;
    }
    if let Some(folder) = &args.pictures {
        let n = picture::write(folder, &drive, &survey, &report)?;
        say!("\n{n} pictures: {}", folder.join("rig.html").display())?;
    }
    let n_doubts = report.doubts().count();
    say!("\n{n_doubts} doubts")?;
    Ok(if n_doubts == 0 { ExitCode::SUCCESS } else { ExitCode::from(exit_code::INCOMPLETE) })
}
