//! Size of the drive, and what a run will make of it.

use super::DriveReport;
use super::lidar::LidarSurvey;
use super::text::bytes;
use formats::drive::Drive;
use formats::lidar::Model;
use formats::velodyne;
use std::path::Path;

/// Bytes of a point in a finished cloud: 51 of the submap, 4 instance, 5 class.
const POINT_BYTES: u64 = 60;
/// Bytes of the color of a point.
const COLOR_BYTES: u64 = 4;

/// Adds facts.
pub fn add(drive: &Drive, path: &Path, lidar: &LidarSurvey, report: &mut DriveReport) {
    let manifest = drive.manifest();
    let n_bytes: u64 = report.streams.iter().map(|stream| stream.n_bytes).sum();
    let mut lines = vec![format!("size of the sensor files: {}", bytes(n_bytes))];
    let mut without = Vec::new();
    if manifest.mosaics.is_empty() {
        without.push("calibrate");
    }
    if manifest.cameras.is_empty() && manifest.mosaics.is_empty() {
        without.push("colorize");
    }
    let options = without.iter().map(|stage| format!(" --without {stage}")).collect::<Vec<_>>().concat();
    lines.push(format!("run: replica-launch launch.toml --set run.drive={}{options}", path.display()));
    let n_points = lidar.n_sweeps.saturating_mul(lidar.n_returns);
    let color = if manifest.cameras.is_empty() { 0 } else { COLOR_BYTES };
    let clouds = bytes(n_points.saturating_mul(POINT_BYTES + color));
    lines.push(format!(
        "returns: about {:.1} million; clouds up to {clouds}, spectra not counted",
        n_points as f64 * 1e-6
    ));
    let has_fixes = report.streams.iter().any(|stream| stream.name == "gnss" && stream.len() > 0);
    lines.push(format!(
        "frame of the clouds: {}",
        if has_fixes { "east, north, up by GNSS" } else { "first pose of the vehicle" }
    ));
    if drive.is_inferred()
        && matches!(drive.model(), Model::Velodyne(velodyne::Model::Hdl64e))
        && drive.sweep_stamps().len() > 1
    {
        lines.push("sweeps of clouds without drive.toml are read as those of an HDL-64E at 10 Hz".to_owned());
    }
    if let Some(truth) = &manifest.truth {
        let labels = if truth.labels.is_some() { "trajectory and labels" } else { "trajectory" };
        lines.push(format!("ground truth: {labels}; after the run: replica evaluate OUT --truth {}", path.display()));
    }
    report.section("Processing", lines);
}
