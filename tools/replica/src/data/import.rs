//! `replica import`: imports a public data set as a drive folder, and a Ladybug calibration as entries of a drive.toml.

mod ladybug;
mod layout;
mod left_out;
mod rows;
mod times;

use anyhow::{Context, bail, ensure};
use formats::drive::{Drive, MANIFEST_FILE, TIMES_FILE};
use formats::lidar::Model;
use formats::manifest::{LidarEntry, Manifest};
use layout::{Kind, Layout};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Import a public data set or a camera calibration.
///
/// The drive folder links to the original files instead of copying them. Only LiDAR sweeps and their times are imported; the files
/// that are not imported are listed.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage")]
pub struct Args {
    /// Folder of KITTI raw (with `velodyne_points/data`), of a KITTI odometry sequence (with `velodyne`), of nuScenes (with
    /// `sweeps/LIDAR_TOP`, or *.pcd.bin), or of *.bin or *.pcd sweeps; or the calibration file of a Ladybug (.cal)
    source: PathBuf,
    /// Drive folder to create; for a calibration, the file to write its `[[camera]]` entries of a drive.toml to
    out: PathBuf,
    /// Layout of the folder; without it the layout is recognized, and files that do not fit it are refused
    #[arg(long, value_enum)]
    kind: Option<Kind>,
    /// Model of the LiDAR, as in drive.toml; default hdl32e for nuScenes, else hdl64e
    #[arg(long, value_parser = model)]
    model: Option<Model>,
    /// nuScenes: the drive to import if the folder holds several: the file names up to `__LIDAR_TOP__`
    #[arg(long)]
    log: Option<String>,
    /// For a calibration: position of the Ladybug in the body frame, m; its axes are parallel to the body's
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', allow_hyphen_values = true, default_value = "0,0,0")]
    position: Vec<f64>,
}

fn model(name: &str) -> Result<Model, String> {
    Model::from_name(name).ok_or_else(|| format!("must be one of {}", Model::names()))
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    for line in import(args)? {
        println!("{line}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Imports and returns the report.
fn import(args: &Args) -> anyhow::Result<Vec<String>> {
    ensure!(!args.out.exists(), "{} exists already", args.out.display());
    if args.source.extension().is_some_and(|extension| extension == "cal") {
        let [x, y, z] = args.position[..] else { bail!("--position {:?} must be three numbers", args.position) };
        let n_cameras = ladybug::import(&args.source, &args.out, [x, y, z])?;
        return Ok(vec![format!("{}: {n_cameras} cameras", args.out.display())]);
    }
    let found = layout::find(&args.source, args.kind, args.log.as_deref())?;
    let n_sweeps = found.sweeps.len();
    ensure!(n_sweeps > 0, "{}: {} has no sweeps", args.source.display(), found.kind.name());
    if let Some(times) = &found.times {
        ensure!(times.len() == n_sweeps, "{}: {n_sweeps} sweeps, but {} times", args.source.display(), times.len());
    }
    rows::check(&found, args.kind.is_some())?;
    let model = args.model.unwrap_or(found.kind.model());
    write(&found, model, &args.source, &args.out)?;
    let drive = Drive::open(&args.out)?;
    ensure!(drive.sweep_files().len() == n_sweeps, "{}: not all sweeps are linked", args.out.display());
    let mut report =
        vec![format!("{}: {n_sweeps} sweeps of {} ({})", args.out.display(), model.name(), found.kind.name())];
    report.push(match &found.times {
        Some(_) => format!("imported: {n_sweeps} sweeps and their times"),
        None => format!("imported: {n_sweeps} sweeps; they have no times: 10 sweeps per second are assumed"),
    });
    if args.model.is_none() && matches!(found.kind, Kind::Bin | Kind::Pcd) {
        report.push(format!("the files do not name the LiDAR: {} is assumed, --model sets another", model.name()));
    }
    report.extend(found.remarks.iter().cloned());
    report.extend(left_out::list(&args.source, &found)?);
    Ok(report)
}

fn write(found: &Layout, model: Model, source: &Path, out: &Path) -> anyhow::Result<()> {
    let lidar = out.join("lidar");
    fs::create_dir_all(&lidar).with_context(|| lidar.display().to_string())?;
    for (link, sweep) in &found.sweeps {
        let link = lidar.join(link);
        std::os::unix::fs::symlink(sweep, &link).with_context(|| link.display().to_string())?;
    }
    if let Some(times) = &found.times {
        let lines: Vec<String> = times.iter().map(i64::to_string).collect();
        fs::write(lidar.join(TIMES_FILE), lines.join("\n") + "\n")?;
    }
    let name = source.canonicalize()?.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let manifest = Manifest::of_lidar(
        &format!("{name} ({})", found.kind.name()),
        LidarEntry {
            model: model.name().into(),
            format: found.kind.format().into(),
            folder: "lidar".into(),
            calibration: None,
            body_from_lidar: found.kind.body_from_lidar(),
        },
    );
    fs::write(out.join(MANIFEST_FILE), toml::to_string(&manifest)?)?;
    Ok(())
}

#[cfg(test)]
mod tests;
