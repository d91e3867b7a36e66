//! Sweeps of both KITTI layouts.

use crate::Options;
use crate::error::ImportError;
use crate::files::files;
use crate::numbered::Stamps;
use crate::rows::{self, Rows};
use crate::sweeps::{LIDAR_FOLDER, Sweeps};
use drive::manifest::LidarEntry;
use geometry::Pose;
use lidar::velodyne;
use std::path::{Path, PathBuf};

/// Sweeps with the numbers of their files.
pub(crate) struct KittiSweeps {
    pub sweeps: Sweeps,
    /// Number of each sweep: its line in the files of times and poses. Empty without times.
    pub numbers: Vec<usize>,
    /// The file of the times, if there is one.
    pub times: Option<PathBuf>,
    /// Lines of the report.
    pub notes: Vec<String>,
}

/// Reads the names and times of the sweeps. `needs_stamps`: other sensors have stamps, so the sweeps need stamps as well.
pub(crate) fn read(
    data: &Path,
    times: &Path,
    nanos: fn(&str) -> Option<i64>,
    needs_stamps: bool,
    options: &Options,
) -> Result<KittiSweeps, ImportError> {
    let mut notes = Vec::new();
    let (sweeps, numbers, times) = if times.exists() {
        let stamps = Stamps::read(times, nanos)?;
        let files = stamps.files(data, ".bin")?;
        let n_absent = stamps.len() - files.len();
        if n_absent > 0 {
            notes.push(format!("{n_absent} of {} stamps have no sweep", stamps.len()));
        }
        let numbers = files.iter().map(|file| file.number).collect();
        let stamps = files.iter().map(|file| file.stamp).collect();
        // Drives read their sweeps in the order of the names.
        let files = files.into_iter().map(|file| (format!("{:010}.bin", file.number), file.path)).collect();
        (Sweeps { files, times: Some(stamps) }, numbers, Some(times.to_owned()))
    } else if needs_stamps {
        let rule = "is absent; the sweeps need it to match other sensors. --lidar-only imports the sweeps alone";
        return Err(ImportError::at(times, rule));
    } else {
        (Sweeps { files: files(data, ".bin")?, times: None }, Vec::new(), None)
    };
    sweeps.check(data)?;
    rows::check(&sweeps.files, Rows::kitti(options.kind.is_some()))?;
    Ok(KittiSweeps { sweeps, numbers, times, notes })
}

/// The LiDAR.
pub(crate) fn lidar(options: &Options, body_from_lidar: Pose) -> LidarEntry {
    let model = options.model.unwrap_or(velodyne::Model::Hdl64e.into());
    LidarEntry::new(model.name(), "bin", LIDAR_FOLDER, body_from_lidar.into())
}
