//! Estimates the disk space for the clouds of a recorded drive from its first sweeps, before a run.

use crate::cloud_columns::{CloudFields, header_of, point_columns};
use drive::{Drive, SweepSource};
use lidar::SweepError;

/// Number of sweeps from which the number of points is estimated. One sweep of a capture may be truncated; ten are read
/// in about 50 ms.
const SAMPLE_SWEEPS: usize = 10;

/// Share of the points that a mosaic camera records, and that are also written with their spectra: 6.4 % in the sample
/// drive, whose two cameras face the sides.
const SHARE_WITH_SPECTRA: f64 = 0.064;

/// Numbers of points and bytes of clouds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpaceNeed {
    /// Number of points.
    pub points: u64,
    /// Number of bytes of all clouds.
    pub bytes: u64,
}

/// Space for clouds with these fields, and with spectra if `has_spectra` is set and the drive has mosaic cameras. In
/// drives with changing surroundings, for example from a street to a field, the estimate is off by up to a half.
pub fn space_need(drive: &Drive, fields: &CloudFields<'_>, has_spectra: bool) -> Result<SpaceNeed, SweepError> {
    let mut points = 0.0;
    for lidar in drive.lidars() {
        points += estimated_points(&mut SweepSource::open(lidar)?)?;
    }
    let has_lidars = drive.lidars().count() > 1;
    let columns = point_columns(has_lidars).chain(fields.columns.iter().copied());
    let row_bytes = header_of(fields.coordinates, columns).row_size() as f64;
    // Position, number of the point, and the bands of all cameras.
    let n_bands: usize = drive.expected_bands().iter().map(Vec::len).sum();
    let spectrum_bytes = if has_spectra && n_bands > 0 { 4 * (4 + n_bands) } else { 0 };
    let spectra_bytes = SHARE_WITH_SPECTRA * spectrum_bytes as f64;
    Ok(SpaceNeed { points: points as u64, bytes: (points * (row_bytes + spectra_bytes)) as u64 })
}

/// Points of the first sweeps, divided by their share of the drive.
fn estimated_points(sweeps: &mut SweepSource) -> Result<f64, SweepError> {
    let mut n_points = 0;
    let mut n_sweeps = 0;
    while n_sweeps < SAMPLE_SWEEPS && sweeps.next_sweep(|points| n_points += points.len())?.is_some() {
        n_sweeps += 1;
    }
    // A reader that has just started has progress 0 and no points.
    Ok(n_points as f64 / sweeps.progress().max(1e-9))
}
