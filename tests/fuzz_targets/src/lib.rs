//! Every reader of files, packets and requests as a function of bytes.
//!
//! A target must return for any bytes: no panic, no endless loop, and no more memory than [`memory_limit`] allows. `fuzz/` runs the
//! targets with libFuzzer. The binary `attack` runs them with seeded mutations of the corpus, without a nightly compiler.

mod captures;
mod clouds;
mod images;
mod lidars;
mod mutation;
mod programs;
mod spectra;
mod texts;

pub use mutation::{corpus, input};

use std::io::Write;
use std::path::Path;

/// A target: its name, which is that of its corpus, and its function.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 36] = [
    ("pcap", captures::capture),
    ("pcapng", captures::capture),
    ("hdl32e", captures::hdl32e),
    ("vlp16", captures::vlp16),
    ("hdl64e", captures::hdl64e),
    ("hesai", lidars::hesai),
    ("ouster", lidars::ouster),
    ("robosense", lidars::robosense),
    ("livox", lidars::livox),
    ("lidar_calibration", lidars::calibration),
    ("nmea", captures::nmea),
    ("imu", captures::imu),
    ("png", images::color),
    ("jpeg", images::color),
    ("pgm", images::pgm),
    ("tiff", images::tiff),
    ("raw_mosaic", images::raw_mosaic),
    ("ply", clouds::ply),
    ("pcd", clouds::pcd),
    ("kitti", clouds::kitti),
    ("nuscenes", clouds::nuscenes),
    ("npy", clouds::npy),
    ("envi", spectra::envi),
    ("spectral_library", spectra::library),
    ("ecostress", spectra::ecostress),
    ("sensor_calibration", spectra::sensor_calibration),
    ("ladybug", texts::ladybug),
    ("tum", texts::tum),
    ("trajectory_csv", texts::trajectory_csv),
    ("kitti_poses", texts::kitti_poses),
    ("launch_file", programs::launch_file),
    ("drive_manifest", programs::drive_manifest),
    ("mcap", programs::mcap),
    ("model", programs::model),
    ("state", programs::state),
    ("control", programs::control),
];

/// Memory that a target may hold at a time, bytes: a fixed part for tables and buffers, and a multiple of the input, because text
/// and compressed images grow when they are decoded.
pub fn memory_limit(input: &[u8]) -> usize {
    (64 << 20) + 100 * input.len()
}

/// The function of a target.
pub fn target(name: &str) -> Option<fn(&[u8])> {
    TARGETS.iter().find(|(known, _)| *known == name).map(|(_, function)| *function)
}

/// Calls `read` with a file of these bytes.
fn with_file(name: &str, bytes: &[u8], read: impl FnOnce(&Path)) {
    let file = tempfile::Builder::new().suffix(name).tempfile();
    let mut file = file.expect("a temporary file");
    file.write_all(bytes).expect("writes");
    read(file.path());
}
