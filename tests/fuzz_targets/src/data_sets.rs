//! Files of third-party data sets, and calibrations of their rigs.

use crate::accepted::accepted;
use crate::bags::import;
use crate::scratch::{parts, with_file, with_files};
use import::Kind;
use rig::source::{FrameTree, SourceOptions, read};
use std::path::Path;
use std::sync::LazyLock;

/// A chunk of a `MandEye`; the target adds its IMU. Not compressed: setting up the decoder takes longer than the rest.
const CHUNK: &[u8] = include_bytes!("../corpus/las/seed_0");
/// The header of a PNG image of 20 x 10 pixels.
const IMAGE: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x14\0\0\0\x0a\x08\x02\0\0\0";
/// A sweep of one return.
const SWEEP: [u8; 20] = [0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 0, 0, 0, 0, 0, 0, 0x80, 0x3f, 0, 0, 0, 0];

pub(crate) fn las(bytes: &[u8]) {
    with_files(&[("source/0.las", bytes)], |folder| import(&folder.join("source"), Kind::Las));
}

pub(crate) fn laz(bytes: &[u8]) {
    with_files(&[("source/lidar0.laz", bytes)], |folder| import(&folder.join("source"), Kind::Mandeye));
}

/// Samples of the IMU of a `MandEye`.
pub(crate) fn mandeye_imu(bytes: &[u8]) {
    let files = [("source/lidar0.laz", CHUNK), ("source/imu0.csv", bytes)];
    with_files(&files, |folder| import(&folder.join("source"), Kind::Mandeye));
}

/// Fixes of a `MandEye`: sentences, then values.
pub(crate) fn mandeye_gnss(bytes: &[u8]) {
    let [sentences, values] = parts(bytes);
    for (name, log) in [("source/gnss0.nmea", sentences), ("source/gnss0.gnss", values)] {
        with_files(&[("source/lidar0.laz", CHUNK), (name, log)], |folder| {
            import(&folder.join("source"), Kind::Mandeye);
        });
    }
}

/// Calibrations, poses and samples of the IMU of a Boreas sequence.
pub(crate) fn boreas(bytes: &[u8]) {
    const NAMES: [&str; 5] = [
        "source/calib/T_applanix_lidar.txt",
        "source/calib/T_camera_lidar.txt",
        "source/calib/P_camera.txt",
        "source/applanix/lidar_poses.csv",
        "source/applanix/imu_raw.csv",
    ];
    // A return of each laser of the sweep.
    static SWEEP: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let row = |laser: u8| {
            let elevation = (0.3125 * f32::from(laser) - 25.0).to_radians();
            [20.0 * elevation.cos(), 0.0, 20.0 * elevation.sin(), 17.0, f32::from(laser), 0.0]
        };
        (0..128).flat_map(row).flat_map(f32::to_le_bytes).collect()
    });
    let texts: [&[u8]; 5] = parts(bytes);
    let mut files: Vec<(&str, &[u8])> = NAMES.into_iter().zip(texts).filter(|(_, text)| !text.is_empty()).collect();
    files.push(("source/lidar/1630597330954834.bin", &SWEEP));
    files.push(("source/camera/1630597330984834.png", IMAGE));
    with_files(&files, |folder| import(&folder.join("source"), Kind::Boreas));
}

/// The tables of a scene.
pub(crate) fn nuscenes_tables(bytes: &[u8]) {
    const NAMES: [&str; 11] = [
        "source/v1.0-mini/scene.json",
        "source/v1.0-mini/log.json",
        "source/v1.0-mini/sensor.json",
        "source/v1.0-mini/calibrated_sensor.json",
        "source/v1.0-mini/sample.json",
        "source/v1.0-mini/sample_data.json",
        "source/v1.0-mini/ego_pose.json",
        "source/v1.0-mini/sample_annotation.json",
        "source/v1.0-mini/instance.json",
        "source/v1.0-mini/category.json",
        "source/v1.0-mini/lidarseg.json",
    ];
    let tables: [&[u8]; 11] = parts(bytes);
    let mut files: Vec<(&str, &[u8])> = NAMES.into_iter().zip(tables).filter(|(_, table)| !table.is_empty()).collect();
    files.extend([
        ("source/samples/LIDAR_TOP/a__LIDAR_TOP__1.pcd.bin", &SWEEP[..]),
        ("source/samples/CAM_FRONT/a__CAM_FRONT__1.jpg", b""),
        ("source/lidarseg/v1.0-mini/a.bin", b"\x01"),
    ]);
    with_files(&files, |folder| import(&folder.join("source"), Kind::Nuscenes));
}

/// Calibrations, times and records of a day of KITTI.
pub(crate) fn kitti_raw(bytes: &[u8]) {
    const NAMES: [&str; 6] = [
        "day/calib_imu_to_velo.txt",
        "day/calib_velo_to_cam.txt",
        "day/calib_cam_to_cam.txt",
        "day/drive/velodyne_points/timestamps.txt",
        "day/drive/oxts/timestamps.txt",
        "day/drive/oxts/data/0000000000.txt",
    ];
    let texts: [&[u8]; 6] = parts(bytes);
    let mut files: Vec<(&str, &[u8])> = NAMES.into_iter().zip(texts).filter(|(_, text)| !text.is_empty()).collect();
    files.push(("day/drive/velodyne_points/data/0000000000.bin", &SWEEP[..16]));
    files.push(("day/drive/image_02/data/0000000000.png", IMAGE));
    files.push(("day/drive/image_02/timestamps.txt", b"2011-09-26 13:02:25.5\n"));
    with_files(&files, |folder| import(&folder.join("day/drive"), Kind::KittiRaw));
}

/// Stamps and samples of the IMU in tables next to sweeps.
pub(crate) fn plain_tables(bytes: &[u8]) {
    let [times, imu, poses] = parts(bytes);
    let sweep = ("source/0.bin", &SWEEP[..16]);
    let files = [sweep, ("source/times.txt", times), ("source/imu.csv", imu), ("source/poses.txt", poses)];
    let files: Vec<(&str, &[u8])> = files.into_iter().filter(|(_, bytes)| !bytes.is_empty()).collect();
    with_files(&files, |folder| import(&folder.join("source"), Kind::Bin));
}

/// Reads a calibration without and with the options that it may need.
fn rig(path: &Path) {
    let options = SourceOptions { image_size: Some([640, 480]), log: Some("a".to_owned()), ..SourceOptions::default() };
    let mut tree = FrameTree::default();
    for options in [SourceOptions::default(), options] {
        let read = read(path, &options, &mut tree);
        accepted(&read);
        let Ok(mut parts) = read else { continue };
        if parts.mount(&tree, &options).is_ok() {
            let lidar = drive::manifest::LidarEntry::from_captures("vlp16", geometry::Pose::identity().into());
            let _ = parts.manifest("a", lidar, Some([48.0, 2.0, 0.0]));
        }
    }
}

/// Calibrations of Kalibr, OpenCV and `camera_info`, and trees of frames.
pub(crate) fn rig_yaml(bytes: &[u8]) {
    with_file("a.yaml", bytes, rig);
}

/// The calibration of a Ladybug.
pub(crate) fn rig_ladybug(bytes: &[u8]) {
    with_file("a.cal", bytes, rig);
}

/// Calibrations of KITTI, raw and odometry.
pub(crate) fn rig_kitti(bytes: &[u8]) {
    const NAMES: [&str; 4] =
        ["day/calib.txt", "day/calib_cam_to_cam.txt", "day/calib_velo_to_cam.txt", "day/calib_imu_to_velo.txt"];
    let texts: [&[u8]; 4] = parts(bytes);
    let files: Vec<(&str, &[u8])> = NAMES.into_iter().zip(texts).filter(|(_, text)| !text.is_empty()).collect();
    with_files(&files, |folder| rig(&folder.join("day")));
}

/// Calibrated sensors of nuScenes.
pub(crate) fn rig_nuscenes(bytes: &[u8]) {
    const NAMES: [&str; 3] = ["calibrated_sensor.json", "sensor.json", "sample_data.json"];
    let tables: [&[u8]; 3] = parts(bytes);
    let files: Vec<(&str, &[u8])> = NAMES.into_iter().zip(tables).collect();
    with_files(&files, |folder| rig(&folder.join("calibrated_sensor.json")));
}
