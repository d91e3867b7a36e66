//! Drives and messages for the tests of this stage.

pub mod painted_street;

use drive::manifest::{CameraEntry, LidarEntry, Manifest, MosaicEntry, PoseEntry};
use geometry::{CameraModel, Pose};
use messages::{PoseRow, StampedPose, SubmapHeader, SubmapPoint, SubmapSweep};
use tempfile::TempDir;

/// A drive with a LiDAR only.
pub fn bare_manifest() -> Manifest {
    Manifest::with_lidar("test", LidarEntry::from_captures("hdl32e", PoseEntry::IDENTITY))
}

pub fn camera(name: &str, body_from_camera: Pose, model: CameraModel) -> CameraEntry {
    CameraEntry {
        delay_nanos: 0,
        name: name.to_owned(),
        folder: format!("camera/{name}"),
        exposure_nanos: 1_000_000,
        body_from_camera: body_from_camera.into(),
        model,
    }
}

pub fn mosaic(name: &str, body_from_camera: Pose, model: CameraModel, pattern: u32, area: [u32; 4]) -> MosaicEntry {
    MosaicEntry {
        name: name.to_owned(),
        folder: name.to_owned(),
        sensor: None,
        exposure_nanos: 5_000_000,
        delay_nanos: 0,
        dark_exposure_nanos: 5_000_000,
        white_exposure_nanos: 5_000_000,
        white_reflectance: 0.98,
        white_panel: None,
        bit_depth: 10,
        pattern,
        active_area: area,
        wavelengths_nm: (0..pattern * pattern).map(|k| 500.0 + 10.0 * f64::from(k)).collect(),
        body_from_camera: body_from_camera.into(),
        model,
    }
}

/// The folder of a drive whose sensors recorded nothing.
pub fn drive(manifest: &Manifest) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let color_folders = manifest.cameras.iter().map(|entry| &entry.folder);
    let folders =
        color_folders.chain(manifest.mosaics.iter().map(|entry| &entry.folder)).chain([&manifest.lidar.folder]);
    for name in folders {
        std::fs::create_dir_all(folder.path().join(name)).expect("made");
    }
    std::fs::write(folder.path().join(&manifest.lidar.folder).join("0.pcap"), b"").expect("written");
    let text = stage::toml::to_string(manifest).expect("encodes");
    std::fs::write(folder.path().join("drive.toml"), text).expect("written");
    folder
}

/// A submap of one sweep.
pub fn submap(odom_from_submap: Pose, stamp_begin: i64, points: &[SubmapPoint]) -> SubmapHeader {
    let last = points.iter().map(|point| point.offset_nanos).max().unwrap_or_default();
    let mut header = SubmapHeader {
        stamp_begin,
        stamp_end: stamp_begin + i64::from(last),
        odom_from_submap: odom_from_submap.into(),
        n_sweeps: 1,
        n_rings: 32,
        ..SubmapHeader::default()
    };
    header.sweeps[0] = SubmapSweep {
        stamp: stamp_begin,
        duration_nanos: last,
        n_points: points.len() as u32,
        ..SubmapSweep::default()
    };
    header
}

pub fn stamped(stamp: i64, odom_from_body: Pose) -> StampedPose {
    StampedPose { stamp, odom_from_body: PoseRow::from(odom_from_body) }
}
