//! The real pipeline and a drive for it.

use crate::launch::patient;
use crate::shared::made_once;
use crate::{Launch, binary};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The drive of nearly all tests: four seconds of street with all sensors.
pub fn drive() -> PathBuf {
    let made = made_once("drive", &["replica"], |folder| {
        simulated_drive(&folder.join("drive"), &["--seed", "5", "--seconds", "4"]);
    });
    made.join("drive")
}

/// Twelve seconds with LiDAR, IMU and GNSS only: more than the stages hold in flight, so that a test can act before the
/// end of the run.
pub fn long_drive() -> PathBuf {
    let arguments = ["--seed", "5", "--seconds", "12", "--rig", "survey"];
    made_once("long_drive", &["replica"], |folder| simulated_drive(&folder.join("drive"), &arguments)).join("drive")
}

/// Four seconds of a vehicle with two LiDARs, without cameras.
pub fn two_lidar_drive() -> PathBuf {
    let arguments = ["--seed", "5", "--seconds", "4", "--rig", "twin"];
    made_once("two_lidar_drive", &["replica"], |folder| simulated_drive(&folder.join("drive"), &arguments))
        .join("drive")
}

/// Simulates a drive in `folder`; `arguments` of `replica simulate`.
pub fn simulated_drive(folder: &Path, arguments: &[&str]) {
    let status = Command::new(binary("replica"))
        .arg("simulate")
        .args(arguments)
        .arg("--out")
        .arg(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .expect("replica starts");
    assert!(status.success(), "replica simulate: {status}");
}

/// Keys of `[slam_aggregate]`: seconds of street are too short to find north by fixes, and no test of processes depends on it.
pub const ANY_FIXES: &str = "min_used_fixes_share = 0.0";
/// Keys of `[export]` for the same reason.
pub const ANY_DEVIATION: &str =
    "max_position_deviation_m = 1000.0\nmax_height_deviation_m = 1000.0\nmax_heading_deviation_deg = 180.0";

/// All stages, with submaps short enough that four seconds from rest have several. `run` are further keys of `[run]`,
/// `infer` the keys of `[infer]`; empty for the model of the project.
pub fn pipeline(drive: &Path, run: &str, infer: &str) -> Launch {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/ground.safetensors");
    let infer = if infer.is_empty() { format!("model = '{}'", model.display()) } else { infer.to_owned() };
    Launch::new(&format!(
        "[run]\ndrive = '{}'\noutput = 'out'\nbarrier_s = 0.5\nrestart_delay_s = 0.0\n{}\n\
         [acquire]\n[calibrate]\n[slam_aggregate]\nsubmap_m = 3.0\n{ANY_FIXES}\n[colorize]\n[infer]\n{infer}\n\
         [instance]\n\
         things = [{{ class = 'vehicles', max_height_m = 4.0, min_points = 200 }}]\n[export]\n{ANY_DEVIATION}\n",
        drive.display(),
        patient(run)
    ))
}

/// The stages of [`pipeline`] that need only a LiDAR.
pub fn lidar_pipeline(drive: &Path, run: &str) -> Launch {
    let without = ["calibrate", "colorize", "infer", "instance"];
    without.iter().fold(pipeline(drive, run, ""), |launch, stage| launch.with("--without").with(stage))
}
