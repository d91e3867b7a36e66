//! KITTI raw and KITTI odometry (Geiger et al., CVPR 2012).

use crate::error::ImportError;
use crate::files::files;
use crate::plan::Plan;
use crate::rows::{self, Rows};
use crate::sweeps::{LIDAR_FOLDER, Sweeps};
use crate::times::{nanos_of_date, nanos_of_seconds, read_times};
use crate::{Kind, Options};
use formats::manifest::{LidarEntry, Manifest, PoseEntry};
use formats::velodyne;
use std::path::Path;

/// The drive of a folder of KITTI raw.
pub(crate) fn raw(source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let folder = source.join("velodyne_points");
    plan(Kind::KittiRaw, source, &folder.join("data"), &folder.join("timestamps.txt"), nanos_of_date, options)
}

/// The drive of a sequence of KITTI odometry.
pub(crate) fn odometry(source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let (data, times) = (source.join("velodyne"), source.join("times.txt"));
    plan(Kind::KittiOdometry, source, &data, &times, nanos_of_seconds, options)
}

fn plan(
    kind: Kind,
    source: &Path,
    data: &Path,
    times: &Path,
    nanos: fn(&str) -> Option<i64>,
    options: &Options,
) -> Result<Plan, ImportError> {
    let times_file = times.exists().then(|| times.to_owned());
    let times = times_file.as_ref().map(|path| read_times(path, nanos)).transpose()?;
    let sweeps = Sweeps { files: files(data, ".bin")?, times };
    sweeps.check(source)?;
    rows::check(&sweeps.files, Rows::of_kitti(options.kind.is_some()))?;
    let lidar = LidarEntry {
        model: options.model.unwrap_or(velodyne::Model::Hdl64e.into()).name().into(),
        format: "bin".into(),
        folder: LIDAR_FOLDER.into(),
        calibration: None,
        body_from_lidar: PoseEntry::IDENTITY,
    };
    Ok(Plan {
        kind,
        manifest: Manifest::of_lidar(&crate::drive_name(source, kind), lidar),
        links: sweeps.links(),
        texts: sweeps.times_file().into_iter().collect(),
        read: times_file.into_iter().collect(),
        report: vec![sweeps.report()],
    })
}
