//! Calibration files: matrices of numbers, one row per line.

use crate::cameras::Projection;
use crate::error::{At, ImportError};
use files::text_file::{MAX_SETTINGS_BYTES, read_text};
use formats::trajectory::poses_from_kitti;
use geometry::Pose;
use std::path::Path;

/// A rigid 4x4 matrix.
pub(super) fn transform(path: &Path) -> Result<Pose, ImportError> {
    let rows = rows(path, 4..=4)?;
    let upper: Vec<String> = rows[..12].iter().map(f64::to_string).collect();
    let poses = poses_from_kitti(&upper.join(" ")).map_err(|error| ImportError::at(path, error.fault.to_string()))?;
    poses.first().copied().ok_or_else(|| ImportError::at(path, "must be a 4x4 matrix"))
}

/// The projection of the rectified images: a 3x4 or 4x4 matrix.
pub(super) fn projection(path: &Path) -> Result<Projection, ImportError> {
    let rows = rows(path, 3..=4)?;
    let upper = rows.first_chunk().copied();
    upper.and_then(Projection::from_rows).ok_or_else(|| ImportError::at(path, Projection::RULE))
}

/// The numbers of this many rows of four.
fn rows(path: &Path, n_rows: std::ops::RangeInclusive<usize>) -> Result<Vec<f64>, ImportError> {
    if !path.is_file() {
        let rule = "is absent; poses, images and the IMU need it. --lidar-only imports the sweeps alone";
        return Err(ImportError::at(path, rule));
    }
    let text = read_text(path, MAX_SETTINGS_BYTES).at(path)?;
    let mut numbers: Vec<f64> = Vec::new();
    for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
        let row: Option<Vec<f64>> = line.split_whitespace().map(|word| word.parse().ok()).collect();
        let row = row.filter(|row| row.len() == 4 && row.iter().all(|value| value.is_finite()));
        numbers.extend(row.ok_or_else(|| ImportError::at_line(path, number, "must be four finite numbers"))?);
    }
    let has_last = numbers.len() < 16 || numbers[12..] == [0.0, 0.0, 0.0, 1.0];
    if !n_rows.contains(&(numbers.len() / 4)) || !has_last {
        return Err(ImportError::at(path, "must be a matrix of four rows, the last one 0 0 0 1"));
    }
    Ok(numbers)
}
