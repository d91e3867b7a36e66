//! Checks that the files of a layout hold what the layout says: rows without header have no other mark.

use super::layout::{Kind, Layout};
use anyhow::{Context, bail};
use formats::cloud::{CloudPoint, check_points};
use formats::{kitti, nuscenes};
use std::path::{Path, PathBuf};

/// Sweeps whose values are checked, spread over the drive: all would be gigabytes.
const CHECKED: usize = 8;
/// Largest remission of KITTI.
const KITTI_INTENSITY: f32 = 1.0;
/// Largest intensity of a sensor.
const SENSOR_INTENSITY: f32 = 255.0;

/// Checks the sizes of all sweeps and the values of some. A layout that the user names may have the intensities of a sensor.
pub fn check(found: &Layout, is_forced: bool) -> anyhow::Result<()> {
    let row_bytes: u64 = match found.kind {
        Kind::Pcd => return Ok(()),
        Kind::Nuscenes => 20,
        Kind::KittiRaw | Kind::KittiOdometry | Kind::Bin => 16,
    };
    for (_, path) in &found.sweeps {
        let n_bytes = path.metadata().with_context(|| path.display().to_string())?.len();
        if n_bytes == 0 || n_bytes % row_bytes != 0 {
            let name = found.kind.name();
            bail!("{}: {n_bytes} bytes must be rows of {row_bytes} bytes, as in {name}{}", path.display(), hint(path));
        }
    }
    let step = found.sweeps.len().div_ceil(CHECKED);
    for (_, path) in found.sweeps.iter().step_by(step) {
        let result = values(path, found.kind, is_forced);
        result.with_context(|| format!("{}: not a sweep of {}{}", path.display(), found.kind.name(), hint(path)))?;
    }
    Ok(())
}

fn values(path: &PathBuf, kind: Kind, is_forced: bool) -> anyhow::Result<()> {
    let bytes = std::fs::read(path)?;
    let (points, max_intensity) = if kind == Kind::Nuscenes {
        let rows = nuscenes::points_from_bin(&bytes)?;
        (rows.into_iter().map(|(point, _)| point).collect::<Vec<CloudPoint>>(), SENSOR_INTENSITY)
    } else {
        (kitti::points_from_bin(&bytes)?, if is_forced { SENSOR_INTENSITY } else { KITTI_INTENSITY })
    };
    Ok(check_points(&points, max_intensity)?)
}

/// What the file looks like instead.
fn hint(path: &Path) -> &'static str {
    let rows = |bytes: Vec<u8>| nuscenes::points_from_bin(&bytes).is_ok_and(|rows| !rows.is_empty());
    if std::fs::read(path).is_ok_and(rows) {
        "; the rows are those of nuScenes (x y z intensity ring): --kind nuscenes"
    } else {
        "; --kind sets the layout"
    }
}
