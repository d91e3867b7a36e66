//! `replica rig calibrate`: refines a rig by its drive.

use super::PartOfDrive;
use anyhow::{Context, ensure};
use command_line::answer::Answer;
use drive::{Drive, MANIFEST_FILE};
use rig::refine::{Change, Refined};
use rig::survey::Survey;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Refine rotations of cameras and IMU, delays, ring angles and mountings of LiDARs by a drive.
///
/// Prints each value with its difference from drive.toml and its standard deviation, and the values that the drive does not
/// determine. Values that differ by more than two standard deviations are replaced. Without --out nothing is written.
///
/// With a post-processed path, which drive.toml names, the mounting of the LiDAR follows from surfaces that it passes several
/// times. Roll and heading need passes in opposite directions.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica rig calibrate drives/mine --out drives/mine/refined.toml")]
pub struct Args {
    #[command(flatten)]
    part: PartOfDrive,
    /// Further drive of the same vehicle through the same streets, with a path; several are allowed
    #[arg(long, value_name = "DRIVE")]
    pass: Vec<PathBuf>,
    /// File for the refined drive.toml, in the drive folder; a calibration file of the LiDAR is written to the same folder
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace files that exist; without --out, replace the drive.toml of the drive. Comments are lost
    #[arg(long)]
    write: bool,
    #[command(flatten)]
    answer: Answer,
}

/// All values, and the files with the replaced values.
#[derive(Serialize)]
struct Found<'a> {
    changes: &'a [Change],
    written: Vec<PathBuf>,
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let drive = Drive::open(&args.part.drive)?;
    let settings = args.part.settings();
    let survey = Survey::from_drive(&drive, &settings)?;
    let mut refined = Refined::from_survey(&drive, &survey, &settings)?;
    if !args.pass.is_empty() || drive.manifest().trajectory.is_some() {
        let passes: Vec<Drive> = args.pass.iter().map(|folder| Drive::open(folder)).collect::<Result<_, _>>()?;
        refined.add_boresight(&drive, &passes, &settings)?;
    }
    let in_place = args.write.then(|| drive.folder().join(MANIFEST_FILE));
    let out = args.out.clone().or(in_place);
    let has_out = out.is_some();
    let has_changes = refined.has_changes();
    let written = match out.filter(|_| has_changes) {
        Some(out) => write(&refined, out, args.write)?,
        None => Vec::new(),
    };
    let found = Found { changes: &refined.changes, written };
    args.answer.print(&found, || found.text(has_out))?;
    Ok(ExitCode::SUCCESS)
}

/// Writes the refined drive.toml and the files that it refers to. Returns the files.
fn write(refined: &Refined, out: PathBuf, may_replace: bool) -> anyhow::Result<Vec<PathBuf>> {
    let folder = out.parent().unwrap_or(Path::new("")).to_owned();
    let lidar_file = refined.lidar_file.iter().map(|(name, text)| (folder.join(name), text.clone()));
    let files: Vec<_> = lidar_file.chain([(out, toml::to_string(&refined.manifest)?)]).collect();
    for (path, _) in &files {
        ensure!(may_replace || !path.exists(), "{} exists already; --write replaces it", path.display());
    }
    for (path, text) in &files {
        std::fs::write(path, text).with_context(|| path.display().to_string())?;
    }
    Ok(files.into_iter().map(|(path, _)| path).collect())
}

impl Found<'_> {
    fn text(&self, has_out: bool) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        for change in self.changes {
            let _ = writeln!(text, "{change}");
        }
        for path in &self.written {
            let _ = writeln!(text, "\nwritten: {}", path.display());
        }
        if self.written.is_empty() && has_out {
            text.push_str("\nno value is replaced: nothing written\n");
        } else if self.written.is_empty() {
            text.push_str("\nnothing written; --out FILE writes the refined drive.toml\n");
        }
        text
    }
}
