//! Imports third-party recordings and data sets as drive folders, and labeled clouds as recordings
//! (`docs/guide/import_data_sets.md`).
//!
//! A drive folder links to the original files where the drive format can hold them. [`Kind`] lists the layouts.
//!
//! | idea | module |
//! |---|---|
//! | layout of a folder | [`Kind`] |
//! | links and files of the drive folder, written completely or not at all | `plan` |
//! | one layout per module | `boreas`, `kitti`, `las`, `mandeye`, `nuscenes`, `plain`, `ros` |
//! | labeled clouds as recordings | `clouds` |
//! | tables shared by several layouts | `rows`, `imu_table`, `fixes`, `rings` |
//! | post-processed trajectories next to the files | `trajectory` |
//! | files that were left out, for the report | `left_out` |
//!
//! An import must never change the source, guess a calibration or a unit that the source does not state, or leave a partial
//! folder behind. Data that it cannot use is reported, not dropped silently. Sensor data is not interpreted further:
//! deskewing, filtering and matching belong to the stages.
//!
//! Start reading with [`import`], then `plan.rs` and the module of the layout in question. A new layout is one module
//! with a function that fills a `Plan`, and one variant of [`Kind`].

mod boreas;
mod cameras;
mod clouds;
mod error;
mod files;
mod fixes;
mod imu_table;
mod imu_units;
mod kind;
mod kitti;
mod las;
mod left_out;
mod mandeye;
mod numbered;
mod nuscenes;
mod plain;
mod plan;
mod readable;
mod rings;
mod ros;
mod rows;
mod stamp_text;
mod sweeps;
mod times;
mod trajectory;

pub use error::{ImportError, Rule};
pub use kind::Kind;
pub use ros::{LiveData, LiveSensor, LiveTopic, RosOptions};

use drive::Drive;
use error::At;
use lidar::Model;
use plan::{Plan, Written};
use std::fs;
use std::path::{Path, PathBuf};

/// Choices of an import.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The layout. `None`: it is recognized, and files that do not fit it are refused.
    pub kind: Option<Kind>,
    /// Model of the LiDAR. `None`: the model used by the data set.
    pub model: Option<Model>,
    /// `nuScenes`: file names up to `__LIDAR_TOP__` of the drive to import, if the folder holds several.
    pub log: Option<String>,
    /// `nuScenes` with tables: name of the scene to import, if there are several.
    pub scene: Option<String>,
    /// Import only the sweeps and their times, for sources without calibration.
    pub lidar_only: bool,
    /// Options of ROS bags.
    pub ros: RosOptions,
}

/// Imports `source` as the drive folder `out`, or labeled clouds as the recording `out`, which must not exist. Returns
/// lines of a report: imported data and data left out. A failed import leaves no folder.
pub fn import(source: &Path, out: &Path, options: &Options) -> Result<Vec<String>, ImportError> {
    if out.exists() {
        return Err(ImportError::at(out, "exists already"));
    }
    let kind = options.kind.map_or_else(|| Kind::recognize(source), Ok)?;
    for (name, is_given, what) in
        [("--log", options.log.is_some(), "logs"), ("--scene", options.scene.is_some(), "scenes")]
    {
        if is_given && kind != Kind::Nuscenes {
            return Err(ImportError::for_option(name, format!("{} has no {what}", kind.title())));
        }
    }
    if options.ros != RosOptions::default() && kind != Kind::Ros {
        let rule = format!("{} has no topics, frames or calibration to choose", kind.title());
        return Err(ImportError::for_option("--topic, --body-frame, --transform and --calibration", rule));
    }
    if let Some(layout) = kind.clouds() {
        if options.model.is_some() || options.lidar_only {
            let rule = format!("{} has no sweeps of a LiDAR", kind.title());
            return Err(ImportError::for_option("--model and --lidar-only", rule));
        }
        return clouds::import(layout, source, out);
    }
    if out.extension().is_some_and(|extension| extension == clouds::EXTENSION) {
        let rule = format!("{} becomes a drive folder; only labeled clouds become a recording", kind.title());
        return Err(ImportError::at(out, rule));
    }
    let partial = Partial::create(out)?;
    let mut plan = plan(kind, source, &partial.folder, options)?;
    if !options.lidar_only {
        trajectory::add(&mut plan, source)?;
    }
    let Written { n_copied, flags } = plan.write(&partial.folder)?;
    let drive = Drive::open(&partial.folder).at(out)?;
    let n_sweeps = drive.sweep_files().len();
    let model = drive.model().name();
    let file = if drive.manifest().lidar.format == "pcap" { "capture" } else { "sweep" };
    let plural = if n_sweeps == 1 { "" } else { "s" };
    let mut report = vec![format!("{}: {n_sweeps} {file}{plural} of {model} ({})", out.display(), kind.title())];
    report.extend(plan.report.iter().cloned());
    report.extend(flags.lines());
    if n_copied > 0 {
        report.push(format!("{n_copied} files were copied: the file system of the drive has no links"));
    }
    report.extend(readable::check(&drive, &partial.folder, out, kind == Kind::Pcd)?);
    let missing = drive.lidars().flat_map(|lidar| &lidar.missing.texts);
    report.extend(missing.map(|text| format!("files are missing, their time is left out: {text}")));
    report.extend(left_out::list(source, &plan)?);
    partial.rename(out)?;
    Ok(report)
}

/// Plan of the import. Files that must be converted are already written to the folder `out`.
fn plan(kind: Kind, source: &Path, out: &Path, options: &Options) -> Result<Plan, ImportError> {
    match kind {
        Kind::Ros => ros::plan(source, out, options),
        Kind::KittiRaw => kitti::raw::plan(source, options),
        Kind::KittiOdometry => kitti::odometry::plan(source, options),
        Kind::Nuscenes => nuscenes::plan(source, options),
        Kind::Mandeye => mandeye::plan(source, options),
        Kind::Boreas => boreas::plan(source, options),
        _ => plain::plan(kind, source, options),
    }
}

/// Name of a drive for display.
fn drive_name(source: &Path, kind: Kind) -> String {
    let path = source.canonicalize().unwrap_or_else(|_| source.to_owned());
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    format!("{name} ({})", kind.title())
}

/// The drive folder while it is written. It is removed unless it is renamed.
struct Partial {
    folder: PathBuf,
}

impl Partial {
    fn create(out: &Path) -> Result<Self, ImportError> {
        let mut name = out.as_os_str().to_owned();
        name.push(".partial");
        let folder = PathBuf::from(name);
        if let Some(parent) = folder.parent() {
            fs::create_dir_all(parent).at(parent)?;
        }
        fs::create_dir(&folder).at(&folder)?;
        Ok(Self { folder })
    }

    fn rename(&self, out: &Path) -> Result<(), ImportError> {
        fs::rename(&self.folder, out).at(out)
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        // Absent after the renaming.
        let _ = fs::remove_dir_all(&self.folder);
    }
}
