//! Size of the drive, and the expected size and frame of its results.

use super::DriveReport;
use delivery::{CloudFields, SpaceNeed, space_need};
use drive::Drive;
use lidar::{Model, velodyne};
use messages::{ColorTopic, Message};
use run::space::size_text;
use std::path::Path;

/// Adds facts.
pub fn add(drive: &Drive, path: &Path, report: &mut DriveReport) {
    let manifest = drive.manifest();
    let n_bytes: u64 = report.streams.iter().map(|stream| stream.n_bytes).sum();
    let mut lines = vec![format!("size of the sensor files: {}", size_text(n_bytes))];
    let mut without = Vec::new();
    if manifest.mosaics.is_empty() {
        without.push("calibrate");
    }
    if manifest.cameras.is_empty() && manifest.mosaics.is_empty() {
        without.push("colorize");
    }
    let options = without.iter().map(|stage| format!(" --without {stage}")).collect::<Vec<_>>().concat();
    lines.push(format!("run: replica-launch launch.toml --set run.drive={}{options}", path.display()));
    let mut fields = CloudFields::for_default_run();
    if manifest.cameras.is_empty() {
        fields.columns.retain(|column| column.column.topic != ColorTopic::TOPIC);
    }
    // A drive without a readable sweep is reported above.
    if let Ok(SpaceNeed { points, bytes }) = space_need(drive, &fields, true) {
        lines.push(format!("returns: about {:.1} million; clouds: about {}", points as f64 * 1e-6, size_text(bytes)));
    }
    let has_fixes = report.streams.iter().any(|stream| stream.name == "gnss" && stream.len() > 0);
    lines.push(format!(
        "frame of the clouds: {}",
        if has_fixes { "east, north, up by GNSS" } else { "first pose of the vehicle" }
    ));
    if drive.is_inferred()
        && matches!(drive.model(), Model::Velodyne(velodyne::Model::Hdl64e))
        && drive.sweep_stamps().len() > 1
    {
        lines.push("sweeps of clouds without drive.toml are read as sweeps of an HDL-64E at 10 Hz".to_owned());
    }
    if let Some(truth) = &manifest.truth {
        let labels = if truth.labels.is_some() { "trajectory and labels" } else { "trajectory" };
        lines.push(format!(
            "ground truth: {labels}; after the run: replica-lab evaluate OUT --truth {}",
            path.display()
        ));
    }
    report.section("Processing", lines);
}
