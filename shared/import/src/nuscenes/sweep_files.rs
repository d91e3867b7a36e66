//! nuScenes without tables: only the sweeps, with the times in their names.

use super::lidar;
use crate::error::ImportError;
use crate::files::files;
use crate::plan::Plan;
use crate::rows::{self, Rows};
use crate::sweeps::Sweeps;
use crate::{Kind, Options};
use drive::manifest::PoseEntry;
use formats::nuscenes::SweepName;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_1_SQRT_2;
use std::path::{Path, PathBuf};

/// Pose of a lidar frame with x right and y forward in a body frame (x forward, y left) with the same origin.
const BODY_FROM_LIDAR: PoseEntry =
    PoseEntry { translation: [0.0; 3], rotation: [0.0, 0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2] };
/// A longer time between two sweeps is a gap of the data set, ns.
const GAP_NANOS: i64 = 1_000_000_000;
/// Maximum number of logs that an error names.
const MAX_NAMED: usize = 8;

/// The drive of a folder.
pub(super) fn plan(source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let mut folders: Vec<PathBuf> = super::lidar_folders(source).collect();
    if folders.is_empty() {
        folders.push(source.to_owned());
    }
    let mut logs: BTreeMap<String, Vec<(i64, String, PathBuf)>> = BTreeMap::new();
    for folder in &folders {
        for (file_name, path) in files(folder, ".bin")? {
            let Some(name) = SweepName::parse(&file_name) else {
                return Err(ImportError::at(&path, "name must be <log>__LIDAR_TOP__<microseconds>.pcd.bin"));
            };
            logs.entry(name.log).or_default().push((name.end.0, file_name, path));
        }
    }
    let mut found = select_log(source, logs, options.log.as_deref())?;
    found.sort();
    let times: Vec<i64> = found.iter().map(|(time, ..)| *time).collect();
    let n_gaps = times.windows(2).filter(|pair| pair[1] - pair[0] > GAP_NANOS).count();
    // The number keeps the files in the order of their times when sorted by name.
    let file = |(number, (_, name, path)): (usize, (i64, String, PathBuf))| (format!("{number:06}_{name}"), path);
    let sweeps = Sweeps { files: found.into_iter().enumerate().map(file).collect(), times: Some(times) };
    sweeps.check(source)?;
    rows::check(&sweeps.files, Rows::NUSCENES)?;
    let name = crate::drive_name(source, Kind::Nuscenes);
    let mut plan = sweeps.plan(Kind::Nuscenes, &name, lidar(options, BODY_FROM_LIDAR));
    plan.report.push("the body frame is at the LiDAR, with x forward; its height above the ground is not known".into());
    if n_gaps > 0 {
        plan.report.push(format!("{n_gaps} gaps of more than 1 s between sweeps: odometry cannot bridge them"));
    }
    Ok(plan)
}

/// The sweeps of the chosen log, or of the only one.
fn select_log<T>(source: &Path, mut logs: BTreeMap<String, Vec<T>>, log: Option<&str>) -> Result<Vec<T>, ImportError> {
    match (log, logs.len()) {
        (Some(log), _) => logs.remove(log).ok_or_else(|| ImportError::at(source, format!("no log {log}"))),
        (None, 0 | 1) => Ok(logs.pop_first().map(|(_, sweeps)| sweeps).unwrap_or_default()),
        (None, n) => {
            let names = logs.keys().take(MAX_NAMED).map(String::as_str).collect::<Vec<_>>().join(", ");
            let more = if n > MAX_NAMED { ", ..." } else { "" };
            Err(ImportError::at(source, format!("{n} logs; choose one with --log: {names}{more}")))
        }
    }
}
