//! The real pipeline and a drive for it.

use crate::launch::patient;
use crate::shared::made_once;
use crate::{Launch, binary};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The drive of all tests: four seconds of street with all sensors.
pub fn drive() -> PathBuf {
    let made = made_once("drive", &["replica"], |folder| simulated_drive(&folder.join("drive"), 5, 4.0));
    made.join("drive")
}

/// Simulates a drive in `folder`.
pub fn simulated_drive(folder: &Path, seed: u64, seconds: f64) {
    let status = Command::new(binary("replica"))
        .args(["simulate", "--seed", &seed.to_string(), "--seconds", &seconds.to_string(), "--out"])
        .arg(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .expect("replica starts");
    assert!(status.success(), "replica simulate: {status}");
}

/// All stages, with submaps short enough that four seconds from rest have several. `run` are further keys of `[run]`; `infer`
/// those of `[infer]`, empty for the model of the project.
pub fn pipeline(drive: &Path, run: &str, infer: &str) -> Launch {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/ground.safetensors");
    let infer = if infer.is_empty() { format!("model = '{}'", model.display()) } else { infer.to_owned() };
    Launch::new(&format!(
        "[run]\ndrive = '{}'\noutput = 'out'\nbarrier_s = 0.5\nrestart_delay_s = 0.0\n{}\n\
         [acquire]\n[calibrate]\n[slam_aggregate]\nsubmap_m = 3.0\n[colorize]\n[infer]\n{infer}\n\
         [instance]\n\
         things = [{{ class = 'vehicles', max_height_m = 4.0, min_points = 200 }}]\n[export]\n",
        drive.display(),
        patient(run)
    ))
}
