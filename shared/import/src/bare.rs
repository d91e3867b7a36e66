//! Folders of sweeps without any other file.

use crate::error::ImportError;
use crate::files::files;
use crate::plan::Plan;
use crate::rows::{self, Rows};
use crate::sweeps::{LIDAR_FOLDER, Sweeps};
use crate::{Kind, Options};
use formats::lidar::Model;
use formats::manifest::{LidarEntry, PoseEntry};
use formats::velodyne;
use std::path::Path;

/// The drive of a folder of `*.bin` or `*.pcd`.
pub(crate) fn plan(kind: Kind, source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let format = if kind == Kind::Bin { "bin" } else { "pcd" };
    let sweeps = Sweeps { files: files(source, &format!(".{format}"))?, times: None };
    sweeps.check(source)?;
    if kind == Kind::Bin {
        rows::check(&sweeps.files, Rows::of_kitti(options.kind.is_some()))?;
    }
    let model = options.model.unwrap_or(velodyne::Model::Hdl64e.into());
    let lidar = LidarEntry {
        model: model.name().into(),
        format: format.into(),
        folder: LIDAR_FOLDER.into(),
        calibration: None,
        body_from_lidar: PoseEntry::IDENTITY,
    };
    let mut plan = Plan::of_sweeps(kind, &crate::drive_name(source, kind), lidar, &sweeps);
    if options.model.is_none() {
        plan.report.push(assumed(model));
    }
    Ok(plan)
}

fn assumed(model: Model) -> String {
    format!("the files do not name the LiDAR: {} is assumed, --model sets another", model.name())
}
