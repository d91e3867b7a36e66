//! `replica import`: imports a public data set as a drive folder, and a Ladybug calibration as entries of a drive.toml.

mod ladybug;

use anyhow::{Context, bail, ensure};
use formats::calendar::{DAY_NANOS, days_from_date};
use formats::drive::{Drive, MANIFEST_FILE, TIMES_FILE};
use formats::manifest::{LidarEntry, Manifest, PoseEntry};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Import a public data set or a camera calibration.
///
/// The drive folder links to the original files instead of copying them.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage")]
pub struct Args {
    /// Folder of KITTI raw (with `velodyne_points/data`), of a KITTI odometry sequence (with `velodyne`), or of *.bin or *.pcd
    /// sweeps; or the calibration file of a Ladybug (.cal)
    source: PathBuf,
    /// Drive folder to create; for a calibration, the file to write its `[[camera]]` entries of a drive.toml to
    out: PathBuf,
    /// For a calibration: position of the Ladybug in the body frame, m; its axes are parallel to the body's
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', allow_hyphen_values = true, default_value = "0,0,0")]
    position: Vec<f64>,
}

/// The sweeps of a recognized layout.
#[derive(Debug)]
struct Layout {
    name: &'static str,
    format: &'static str,
    sweeps: Vec<PathBuf>,
    /// ns since the Unix epoch. `None`: ten sweeps per second.
    times: Option<Vec<i64>>,
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    ensure!(!args.out.exists(), "{} exists already", args.out.display());
    if args.source.extension().is_some_and(|extension| extension == "cal") {
        let [x, y, z] = args.position[..] else { bail!("--position {:?} must be three numbers", args.position) };
        let n_cameras = ladybug::import(&args.source, &args.out, [x, y, z])?;
        println!("{}: {n_cameras} cameras", args.out.display());
        return Ok(ExitCode::SUCCESS);
    }
    let found = find(&args.source)?;
    if let Some(times) = &found.times {
        let n_sweeps = found.sweeps.len();
        ensure!(times.len() == n_sweeps, "{}: {n_sweeps} sweeps, but {} times", args.source.display(), times.len());
    }
    write(&found, &args.source, &args.out)?;
    let drive = Drive::open(&args.out)?;
    println!(
        "{}: {} sweeps of {} ({})",
        args.out.display(),
        drive.sweep_files().len(),
        drive.model().name(),
        found.name
    );
    Ok(ExitCode::SUCCESS)
}

fn find(source: &Path) -> anyhow::Result<Layout> {
    let raw = source.join("velodyne_points");
    if raw.join("data").is_dir() {
        let times = raw.join("timestamps.txt");
        let times = if times.exists() { Some(read_times(&times, nanos_of_date)?) } else { None };
        return Ok(Layout { name: "KITTI raw", format: "bin", sweeps: files(&raw.join("data"), "bin")?, times });
    }
    if source.join("velodyne").is_dir() {
        let times = source.join("times.txt");
        let times = if times.exists() { Some(read_times(&times, nanos_of_seconds)?) } else { None };
        let sweeps = files(&source.join("velodyne"), "bin")?;
        return Ok(Layout { name: "KITTI odometry", format: "bin", sweeps, times });
    }
    for format in ["bin", "pcd"] {
        let sweeps = files(source, format)?;
        if !sweeps.is_empty() {
            return Ok(Layout { name: "bare sweeps", format, sweeps, times: None });
        }
    }
    bail!("{}: contains neither velodyne_points/data, velodyne, *.bin nor *.pcd", source.display())
}

fn files(folder: &Path, extension: &str) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in folder.read_dir().with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.extension().is_some_and(|found| found == extension) && path.is_file() {
            files.push(path.canonicalize()?);
        }
    }
    files.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    Ok(files)
}

fn read_times(path: &Path, nanos: fn(&str) -> Option<i64>) -> anyhow::Result<Vec<i64>> {
    let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let time = |(index, line): (usize, &str)| {
        nanos(line.trim()).with_context(|| format!("{}:{}: {line:?} is not a valid time", path.display(), index + 1))
    };
    lines.map(time).collect()
}

/// KITTI odometry: seconds since the first sweep.
fn nanos_of_seconds(text: &str) -> Option<i64> {
    let seconds: f64 = text.parse().ok()?;
    (0.0..1e9).contains(&seconds).then(|| (seconds * 1e9).round() as i64)
}

/// KITTI raw: `2011-09-26 13:02:25.951199337`. The time zone is not given; UTC is assumed.
fn nanos_of_date(text: &str) -> Option<i64> {
    let (date, time) = text.split_once(' ')?;
    let [year, month, day] = numbers(date, '-')?;
    let (time, decimals) = time.split_once('.').unwrap_or((time, ""));
    let [hours, minutes, seconds] = numbers(time, ':')?;
    if hours > 23 || minutes > 59 || seconds > 60 || !decimals.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let nanos: i64 = format!("{decimals:0<9.9}").parse().ok()?;
    Some(
        days_from_date(year, month, day)? * DAY_NANOS + ((hours * 60 + minutes) * 60 + seconds) * 1_000_000_000 + nanos,
    )
}

fn numbers(text: &str, separator: char) -> Option<[i64; 3]> {
    let numbers: Option<Vec<i64>> = text.split(separator).map(|part| part.parse().ok().filter(|n| *n >= 0)).collect();
    numbers?.try_into().ok()
}

fn write(found: &Layout, source: &Path, out: &Path) -> anyhow::Result<()> {
    let lidar = out.join("lidar");
    fs::create_dir_all(&lidar).with_context(|| lidar.display().to_string())?;
    for sweep in &found.sweeps {
        let link = lidar.join(sweep.file_name().unwrap_or_default());
        std::os::unix::fs::symlink(sweep, &link).with_context(|| link.display().to_string())?;
    }
    if let Some(times) = &found.times {
        let lines: Vec<String> = times.iter().map(i64::to_string).collect();
        fs::write(lidar.join(TIMES_FILE), lines.join("\n") + "\n")?;
    }
    let name = source.canonicalize()?.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let manifest = Manifest::of_lidar(
        &format!("{name} ({})", found.name),
        LidarEntry {
            model: "hdl64e".into(),
            format: found.format.into(),
            folder: "lidar".into(),
            body_from_lidar: PoseEntry::IDENTITY,
        },
    );
    fs::write(out.join(MANIFEST_FILE), toml::to_string(&manifest)?)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_both_kitti_layouts_are_parsed() {
        assert_eq!(nanos_of_date("2011-09-26 13:02:25.951199337"), Some(1_317_042_145_951_199_337));
        assert_eq!(nanos_of_date("2011-02-30 13:02:25"), None);
        assert_eq!(nanos_of_seconds("1.037875e-01"), Some(103_787_500));
        assert_eq!(nanos_of_seconds("-1"), None);
    }

    #[test]
    fn kitti_raw_folder_becomes_drive_of_links() {
        let folder = tempfile::tempdir().expect("a folder");
        let data = folder.path().join("raw/velodyne_points/data");
        fs::create_dir_all(&data).expect("makes");
        for k in 0..3 {
            fs::write(data.join(format!("{k:010}.bin")), [0; 32]).expect("writes");
        }
        let dates = "2011-09-26 13:02:25.9\n2011-09-26 13:02:26.0\n2011-09-26 13:02:26.125\n";
        fs::write(data.join("../timestamps.txt"), dates).expect("writes");
        let args = Args { source: folder.path().join("raw"), out: folder.path().join("drive"), position: vec![0.0; 3] };
        run(&args).expect("imports");
        let drive = Drive::open(&args.out).expect("opens");
        assert!(!drive.is_inferred());
        assert!(drive.sweep_files().iter().all(|path| path.is_symlink()));
        let mut sweeps = drive.sweeps().expect("opens");
        let mut stamps = Vec::new();
        while let Some(sweep) = sweeps.next_sweep(|_| {}).expect("reads") {
            stamps.push(sweep.stamp.0 - 1_317_042_145_000_000_000);
        }
        assert_eq!(stamps, [900_000_000, 1_000_000_000, 1_125_000_000]);
        assert!(run(&args).is_err(), "an existing drive is not overwritten");
    }
}
