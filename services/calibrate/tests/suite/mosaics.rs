//! Small mosaics of known reflectance, and their drives.

use drive::manifest::{LidarEntry, Manifest, MosaicEntry, PoseEntry};
use formats::pgm::pgm_from_samples;
use geometry::{CameraModel, Pinhole};
use messages::MosaicHeader;
use std::path::Path;
use tempfile::TempDir;

pub const WIDTH: u32 = 43;
pub const HEIGHT: u32 = 29;
pub const STAMP: i64 = 1_700_000_000_123_456_789;
pub const T_WHITE: u64 = 2_000_000;
pub const T_RAW: u64 = 5_000_000;
pub const DARK: u16 = 60;
pub const SATURATION: u16 = 4095;

pub fn entry(name: &str, pattern: u32, active_area: [u32; 4]) -> MosaicEntry {
    let fx = 40.0;
    let fy = 40.0;
    let cx = 21.0;
    let cy = 14.0;
    MosaicEntry {
        name: name.to_owned(),
        folder: name.to_owned(),
        sensor: None,
        exposure_nanos: T_RAW,
        delay_nanos: 0,
        dark_exposure_nanos: T_RAW,
        white_exposure_nanos: T_WHITE,
        white_reflectance: 0.98,
        white_panel: None,
        bit_depth: 12,
        pattern,
        active_area,
        // As on real sensors, the bands are not sorted by wavelength.
        wavelengths_nm: (0..pattern * pattern).map(|k| 470.0 + f64::from(k * 7 % (pattern * pattern))).collect(),
        body_from_camera: PoseEntry::IDENTITY,
        model: CameraModel::Pinhole(Pinhole { width: WIDTH, height: HEIGHT, fx, fy, cx, cy, distortion: [0.0; 5] }),
    }
}

pub fn manifest() -> Manifest {
    let lidar = LidarEntry::from_captures("hdl32e", PoseEntry::IDENTITY);
    let mosaics = vec![entry("hs02", 5, [1, 2, 42, 27]), entry("hs03", 4, [3, 1, 40, 28])];
    Manifest { mosaics, ..Manifest::with_lidar("test", lidar) }
}

/// Counts per ms of a white surface, different for every pixel.
pub fn sensitivity(x: u32, y: u32) -> f64 {
    600.0 + f64::from((x * 13 + y * 29) % 97)
}

pub fn frame(nanos: u64, reflectance: impl Fn(u32, u32) -> f64) -> Vec<u16> {
    let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    let counts = |(x, y): (u32, u32)| sensitivity(x, y) * nanos as f64 * 1e-6 * reflectance(x, y);
    pixels.map(|pixel| DARK + counts(pixel).round() as u16).map(|sample| sample.min(SATURATION)).collect()
}

pub fn write_pgm(path: &Path, samples: &[u16]) {
    std::fs::create_dir_all(path.parent().expect("has a folder")).expect("made");
    std::fs::write(path, pgm_from_samples(WIDTH, HEIGHT, u16::MAX, samples)).expect("written");
}

/// Two dark frames that differ by two counts, so that only their mean is right, and a white one.
pub fn write_references(drive: &Path, name: &str) {
    let dark = |d: u16| vec![DARK - 1 + d; (WIDTH * HEIGHT) as usize];
    write_pgm(&drive.join(name).join("dark/000.pgm"), &dark(0));
    write_pgm(&drive.join(name).join("dark/001.pgm"), &dark(2));
    write_pgm(&drive.join(name).join("white/000.pgm"), &frame(T_WHITE, |_, _| 0.98));
}

pub fn drive(manifest: &Manifest) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir_all(folder.path().join("lidar")).expect("made");
    std::fs::write(folder.path().join("lidar/0.pcap"), b"").expect("written");
    for entry in &manifest.mosaics {
        std::fs::create_dir_all(folder.path().join(&entry.folder)).expect("made");
    }
    std::fs::write(folder.path().join("drive.toml"), stage::toml::to_string(manifest).expect("encodes"))
        .expect("written");
    folder
}

/// A drive with references of both cameras.
pub fn drive_with_references() -> (Manifest, TempDir) {
    let manifest = manifest();
    let folder = drive(&manifest);
    manifest.mosaics.iter().for_each(|entry| write_references(folder.path(), &entry.name));
    (manifest, folder)
}

pub fn header(camera: u32) -> MosaicHeader {
    MosaicHeader { camera, width: WIDTH, height: HEIGHT, bit_depth: 12, exposure_nanos: T_RAW }
}
