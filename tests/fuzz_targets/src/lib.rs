//! Every reader of files, packets and requests as a function of bytes.
//!
//! A target must return for any bytes: no panic, no more memory than [`memory_limit`] allows, and no more work than
//! [`instruction_limit`] allows. Instructions are counted where the processor time is above [`suspicious_time`]: time
//! alone is not a finding, because it grows on a busy machine.
//!
//! `fuzz/` runs the targets with libFuzzer. The binary `attack` runs them with seeded mutations of the corpus, without a nightly
//! compiler.

mod accepted;
mod bags;
mod captures;
mod clouds;
mod data_sets;
mod images;
mod instructions;
mod lidars;
mod mutation;
mod programs;
mod scratch;
mod spectra;
mod texts;

pub use instructions::instructions;
pub use mutation::{corpus, input};

use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;

/// A target: its name, which is also the name of its corpus, and its function.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 69] = [
    ("pcap", captures::capture),
    ("pcapng", captures::capture),
    ("hdl32e", captures::hdl32e),
    ("vlp16", captures::vlp16),
    ("hdl64e", captures::hdl64e),
    ("hesai", lidars::hesai),
    ("ouster", lidars::ouster),
    ("robosense", lidars::robosense),
    ("livox", lidars::livox),
    ("vlp32c", captures::vlp32c),
    ("ouster_metadata", lidars::ouster_metadata),
    ("hesai_angles", lidars::hesai_angles),
    ("robosense_angles", lidars::robosense_angles),
    ("velodyne_calibration", lidars::velodyne_calibration),
    ("nmea", captures::nmea),
    ("imu", captures::imu),
    ("png", images::color),
    ("jpeg", images::color),
    ("multipart", images::multipart),
    ("pgm", images::pgm),
    ("tiff", images::tiff),
    ("raw_mosaic", images::raw_mosaic),
    ("ply", clouds::ply),
    ("pcd", clouds::pcd),
    ("pcd_compressed", clouds::pcd),
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
    ("check_points", texts::check_points),
    ("geoid_grid", texts::geoid_grid),
    ("datum_grid", texts::datum_grid),
    ("launch_file", programs::launch_file),
    ("drive_manifest", programs::drive_manifest),
    ("mcap", programs::mcap),
    ("model", programs::model),
    ("state", programs::state),
    ("control", programs::control),
    ("ros1_bag", bags::bag),
    ("ros2_sqlite", bags::bag),
    ("ros2_mcap", bags::bag),
    ("sqlite", bags::sqlite),
    ("ros2_metadata", bags::metadata),
    ("ros_messages", bags::ros_messages),
    ("las", data_sets::las),
    ("laz", data_sets::laz),
    ("mandeye_imu", data_sets::mandeye_imu),
    ("mandeye_gnss", data_sets::mandeye_gnss),
    ("boreas", data_sets::boreas),
    ("nuscenes_tables", data_sets::nuscenes_tables),
    ("kitti_raw", data_sets::kitti_raw),
    ("plain_tables", data_sets::plain_tables),
    ("rig_yaml", data_sets::rig_yaml),
    ("rig_ladybug", data_sets::rig_ladybug),
    ("rig_kitti", data_sets::rig_kitti),
    ("rig_nuscenes", data_sets::rig_nuscenes),
    ("run_texts", programs::run_texts),
    ("summary", programs::summary),
    ("wiring", programs::wiring),
    ("state_head", programs::state_head),
    ("saved_message", programs::saved_message),
    ("spherical_model", programs::spherical_model),
];

/// Memory that a target may hold at a time, bytes: a fixed part for tables and buffers, and a multiple of the input, because text
/// and compressed images grow when they are decoded.
pub fn memory_limit(input: &[u8]) -> usize {
    (64 << 20) + 100 * input.len()
}

/// Instructions that a call may execute: a fixed part that does not depend on the input (clearing the memory of
/// [`memory_limit`], files), and one that grows with the input.
pub fn instruction_limit(input: &[u8]) -> u64 {
    600_000_000 + 60_000 * input.len() as u64
}

/// Processor time above which the instructions of a call are counted. An idle processor executes [`instruction_limit`]
/// in about twice this time.
pub fn suspicious_time(input: &[u8]) -> Duration {
    Duration::from_millis(100) + Duration::from_micros(10) * input.len() as u32
}

/// Processor time of this thread. Time in which other programs run does not count.
pub fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// The function of a target; `None` for other names. A constant name leaves the other targets out of a program.
pub const fn target(name: &str) -> Option<fn(&[u8])> {
    let mut index = 0;
    while index < TARGETS.len() {
        let (known, function) = TARGETS[index];
        if is_same(known.as_bytes(), name.as_bytes()) {
            return Some(function);
        }
        index += 1;
    }
    None
}

const fn is_same(mut a: &[u8], mut b: &[u8]) -> bool {
    while let ([first, rest_a @ ..], [second, rest_b @ ..]) = (a, b) {
        if *first != *second {
            return false;
        }
        a = rest_a;
        b = rest_b;
    }
    a.is_empty() && b.is_empty()
}
