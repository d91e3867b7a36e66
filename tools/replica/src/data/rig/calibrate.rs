//! `replica rig calibrate`: refines a rig by its drive.

use super::PartOfDrive;
use crate::terminal::say;
use anyhow::{Context, ensure};
use formats::drive::{Drive, MANIFEST_FILE};
use rig::refine::Refined;
use rig::survey::Survey;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Refine rotations of cameras and IMU, delays, ring angles of the LiDAR and mountings of further LiDARs by a drive.
///
/// Prints each value with its difference from drive.toml and the standard deviation, and what the drive does not determine. Values
/// that differ by more than two deviations are replaced. Without --out nothing is written.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage")]
pub struct Args {
    #[command(flatten)]
    part: PartOfDrive,
    /// File for the refined drive.toml, in the drive folder; a calibration file of the LiDAR is written beside it
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace files that exist; without --out, replace the drive.toml of the drive. Comments are lost
    #[arg(long)]
    write: bool,
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let drive = Drive::open(&args.part.drive)?;
    let settings = args.part.settings();
    let survey = Survey::of(&drive, &settings)?;
    let refined = Refined::of(&drive, &survey, &settings)?;
    for change in &refined.changes {
        say!("{change}")?;
    }
    let in_place = args.write.then(|| drive.folder().join(MANIFEST_FILE));
    let Some(out) = args.out.clone().or(in_place) else {
        say!("\nnothing written; --out FILE writes the refined drive.toml")?;
        return Ok(ExitCode::SUCCESS);
    };
    if !refined.has_changes() {
        say!("\nno value is replaced: nothing written")?;
        return Ok(ExitCode::SUCCESS);
    }
    let beside = out.parent().unwrap_or(Path::new(""));
    let mut files = Vec::new();
    if let Some((name, text)) = &refined.lidar_file {
        files.push((beside.join(name), text.clone()));
    }
    files.push((out, toml::to_string(&refined.manifest)?));
    for (path, _) in &files {
        ensure!(args.write || !path.exists(), "{} exists already; --write replaces it", path.display());
    }
    for (path, text) in &files {
        std::fs::write(path, text).with_context(|| path.display().to_string())?;
        say!("\nwritten: {}", path.display())?;
    }
    Ok(ExitCode::SUCCESS)
}
