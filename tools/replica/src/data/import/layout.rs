//! Recognizes the layout of a folder.

use super::times::{nanos_of_date, nanos_of_seconds, read_times};
use anyhow::{Context, bail, ensure};
use formats::lidar::Model;
use formats::manifest::PoseEntry;
use formats::nuscenes::{self, SweepName};
use formats::velodyne;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A longer time between two sweeps is a gap of the data set, ns.
const GAP_NANOS: i64 = 1_000_000_000;

/// A layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// KITTI raw: `velodyne_points/data/*.bin`, `velodyne_points/timestamps.txt`
    KittiRaw,
    /// KITTI odometry: `velodyne/*.bin`, `times.txt`
    KittiOdometry,
    /// `nuScenes`: `samples/LIDAR_TOP` and `sweeps/LIDAR_TOP`, or `*.pcd.bin`; rows of x y z intensity ring as f32
    Nuscenes,
    /// Rows of x y z intensity as f32
    Bin,
    /// Point clouds of PCL
    Pcd,
}

impl Kind {
    /// Name of the data set.
    pub fn name(self) -> &'static str {
        match self {
            Self::KittiRaw => "KITTI raw",
            Self::KittiOdometry => "KITTI odometry",
            Self::Nuscenes => "nuScenes",
            Self::Bin | Self::Pcd => "bare sweeps",
        }
    }
    /// `lidar.format` of the manifest.
    pub fn format(self) -> &'static str {
        match self {
            Self::KittiRaw | Self::KittiOdometry | Self::Bin => "bin",
            Self::Nuscenes => "nuscenes",
            Self::Pcd => "pcd",
        }
    }
    pub fn model(self) -> Model {
        if self == Self::Nuscenes { velodyne::Model::Hdl32e } else { velodyne::Model::Hdl64e }.into()
    }
    pub fn body_from_lidar(self) -> PoseEntry {
        if self == Self::Nuscenes { nuscenes::BODY_FROM_LIDAR } else { PoseEntry::IDENTITY }
    }
}

/// The sweeps of a folder.
#[derive(Debug)]
pub struct Layout {
    pub kind: Kind,
    /// Name in the drive and file, in the order of their times.
    pub sweeps: Vec<(String, PathBuf)>,
    /// ns since the Unix epoch. `None`: ten sweeps per second.
    pub times: Option<Vec<i64>>,
    /// Files with times.
    pub time_files: Vec<PathBuf>,
    /// For the operator.
    pub remarks: Vec<String>,
}

/// The layout of a folder, or of its kind if one is given.
pub fn find(source: &Path, kind: Option<Kind>, log: Option<&str>) -> anyhow::Result<Layout> {
    let kind = kind.map_or_else(|| recognize(source), Ok)?;
    ensure!(log.is_none() || kind == Kind::Nuscenes, "--log: {} has no logs", kind.name());
    match kind {
        Kind::KittiRaw => {
            let folder = source.join("velodyne_points");
            kitti(kind, &folder.join("data"), folder.join("timestamps.txt"), nanos_of_date)
        }
        Kind::KittiOdometry => kitti(kind, &source.join("velodyne"), source.join("times.txt"), nanos_of_seconds),
        Kind::Nuscenes => of_nuscenes(source, log),
        Kind::Bin | Kind::Pcd => {
            let sweeps = files(source, &format!(".{}", kind.format()))?;
            Ok(Layout { kind, sweeps, times: None, time_files: Vec::new(), remarks: Vec::new() })
        }
    }
}

fn recognize(source: &Path) -> anyhow::Result<Kind> {
    let has = |extension: &str| files(source, extension).map(|files| !files.is_empty());
    Ok(if source.join("velodyne_points/data").is_dir() {
        Kind::KittiRaw
    } else if source.join("velodyne").is_dir() {
        Kind::KittiOdometry
    } else if nuscenes_folders(source).next().is_some() || has(".pcd.bin")? {
        Kind::Nuscenes
    } else if has(".bin")? {
        Kind::Bin
    } else if has(".pcd")? {
        Kind::Pcd
    } else {
        let known = "velodyne_points/data, velodyne, sweeps/LIDAR_TOP, *.pcd.bin, *.bin or *.pcd";
        bail!("{}: no known layout; must contain {known}", source.display())
    })
}

fn kitti(kind: Kind, data: &Path, times: PathBuf, nanos: fn(&str) -> Option<i64>) -> anyhow::Result<Layout> {
    let sweeps = files(data, ".bin")?;
    let has_times = times.exists();
    let nanos = has_times.then(|| read_times(&times, nanos)).transpose()?;
    Ok(Layout {
        kind,
        sweeps,
        times: nanos,
        time_files: if has_times { vec![times] } else { Vec::new() },
        remarks: Vec::new(),
    })
}

/// Key frames are in `samples`, the sweeps between them in `sweeps`.
fn nuscenes_folders(source: &Path) -> impl Iterator<Item = PathBuf> {
    ["samples/LIDAR_TOP", "sweeps/LIDAR_TOP"].map(|folder| source.join(folder)).into_iter().filter(|path| path.is_dir())
}

fn of_nuscenes(source: &Path, log: Option<&str>) -> anyhow::Result<Layout> {
    let mut folders: Vec<PathBuf> = nuscenes_folders(source).collect();
    if folders.is_empty() {
        folders.push(source.to_owned());
    }
    let mut logs: BTreeMap<String, Vec<(i64, String, PathBuf)>> = BTreeMap::new();
    for (file_name, path) in
        folders.iter().map(|folder| files(folder, ".bin")).collect::<anyhow::Result<Vec<_>>>()?.concat()
    {
        let Some(name) = SweepName::parse(&file_name) else {
            bail!("{}: name must be <log>__LIDAR_TOP__<microseconds>.pcd.bin", path.display())
        };
        logs.entry(name.log).or_default().push((name.end.0 - nuscenes::TURN_NANOS, file_name, path));
    }
    let mut sweeps = match (log, logs.len()) {
        (Some(log), _) => logs.remove(log).with_context(|| format!("{}: no log {log}", source.display()))?,
        (None, 0 | 1) => logs.pop_first().map(|(_, sweeps)| sweeps).unwrap_or_default(),
        (None, n) => {
            let names = logs.keys().take(8).map(String::as_str).collect::<Vec<_>>().join(", ");
            bail!("{}: {n} logs; choose one with --log: {names}{}", source.display(), if n > 8 { ", ..." } else { "" })
        }
    };
    sweeps.sort();
    let times: Vec<i64> = sweeps.iter().map(|(time, ..)| *time).collect();
    let n_gaps = times.windows(2).filter(|pair| pair[1] - pair[0] > GAP_NANOS).count();
    let mut remarks =
        vec!["the body frame is at the LiDAR, with x forward; its height above the ground is not known".into()];
    if n_gaps > 0 {
        remarks.push(format!("{n_gaps} gaps of more than 1 s between sweeps: odometry cannot bridge them"));
    }
    // The number keeps the order of the times in a listing by name.
    let link = |(number, (_, name, path)): (usize, (i64, String, PathBuf))| (format!("{number:06}_{name}"), path);
    let sweeps = sweeps.into_iter().enumerate().map(link).collect();
    Ok(Layout { kind: Kind::Nuscenes, sweeps, times: Some(times), time_files: Vec::new(), remarks })
}

/// Names and absolute paths of the files of a folder that end so, by name.
pub fn files(folder: &Path, end: &str) -> anyhow::Result<Vec<(String, PathBuf)>> {
    let mut files = Vec::new();
    for entry in folder.read_dir().with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.ends_with(end) && !name.starts_with('.') && path.is_file() {
            files.push((name, path.canonicalize()?));
        }
    }
    files.sort();
    Ok(files)
}
