//! Checks that files of sweeps match the layout: rows without header have no other mark.

use crate::error::{At, ImportError};
use files::regular_file;
use formats::cloud::{CloudPoint, check_points};
use formats::{kitti, nuscenes};
use std::path::{Path, PathBuf};

/// Sweeps whose values are checked, spread over the drive: all sweeps would be gigabytes.
const CHECKED: usize = 8;
/// Largest remission of KITTI.
const KITTI_INTENSITY: f32 = 1.0;
/// Largest intensity of a sensor.
const SENSOR_INTENSITY: f32 = 255.0;

/// Reason why a file does not hold such rows.
type Fault = Box<dyn std::error::Error + Send + Sync>;

/// Rows of a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    name: &'static str,
    n_bytes: u64,
    max_intensity: f32,
    points: fn(&[u8]) -> Result<Vec<CloudPoint>, Fault>,
}

impl Rows {
    /// Rows of x y z intensity ring as f32.
    pub const NUSCENES: Self = Self {
        name: "nuScenes",
        n_bytes: 20,
        max_intensity: SENSOR_INTENSITY,
        points: |bytes| Ok(nuscenes::points_from_bin(bytes)?.into_iter().map(|(point, _)| point).collect()),
    };

    /// Rows of x y z intensity as f32. If the user names the layout, intensities may have the range of a sensor.
    pub fn kitti(is_forced: bool) -> Self {
        let max_intensity = if is_forced { SENSOR_INTENSITY } else { KITTI_INTENSITY };
        Self { name: "KITTI", n_bytes: 16, max_intensity, points: |bytes| Ok(kitti::points_from_bin(bytes)?) }
    }
}

/// Checks the sizes of all sweeps and the values of some.
pub(crate) fn check(sweeps: &[(String, PathBuf)], rows: Rows) -> Result<(), ImportError> {
    let Rows { name, n_bytes: row, .. } = rows;
    for (_, path) in sweeps {
        let n_bytes = path.metadata().at(path)?.len();
        if n_bytes == 0 || n_bytes % row != 0 {
            let rule = format!("{n_bytes} bytes must be rows of {row} bytes, as in {name}{}", hint(path));
            return Err(ImportError::at(path, rule));
        }
    }
    let step = sweeps.len().div_ceil(CHECKED).max(1);
    for (_, path) in sweeps.iter().step_by(step) {
        values(path, rows)
            .map_err(|fault| ImportError::at(path, format!("not a sweep of {name}{}: {fault}", hint(path))))?;
    }
    Ok(())
}

fn values(path: &Path, rows: Rows) -> Result<(), Fault> {
    let points = (rows.points)(&regular_file::read(path)?)?;
    Ok(check_points(&points, rows.max_intensity)?)
}

/// Hint about the likely layout of the file.
fn hint(path: &Path) -> &'static str {
    let rows = |bytes: Vec<u8>| nuscenes::points_from_bin(&bytes).is_ok_and(|rows| !rows.is_empty());
    if regular_file::read(path).is_ok_and(rows) {
        "; the rows have the layout of nuScenes (x y z intensity ring): --kind nuscenes"
    } else {
        "; --kind sets the layout, and takes intensities of up to 255"
    }
}
