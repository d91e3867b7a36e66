//! Imports of a drive of KITTI raw in the published format, with the calibration of its day.

use super::support::{Import, error, folder, import_from, png, write_file};
use drive::Drive;
use geometry::{Point3, Stamp, Trajectory};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const CAM_TO_CAM: &str = "calib_time: 09-Jan-2012 13:57:47
corner_dist: 9.950000e-02
S_02: 1.392000e+03 5.120000e+02
R_rect_00: 9.999239e-01 9.837760e-03 -7.445048e-03 -9.869795e-03 9.999421e-01 -4.278459e-03 7.402527e-03 4.351614e-03 9.999631e-01
S_rect_02: 1.242000e+03 3.750000e+02
P_rect_02: 7.215377e+02 0.000000e+00 6.095593e+02 4.485728e+01 0.000000e+00 7.215377e+02 1.728540e+02 2.163791e-01 0.000000e+00 0.000000e+00 1.000000e+00 2.745884e-03
S_rect_03: 1.242000e+03 3.750000e+02
P_rect_03: 7.215377e+02 0.000000e+00 6.095593e+02 -3.395242e+02 0.000000e+00 7.215377e+02 1.728540e+02 2.199936e+00 0.000000e+00 0.000000e+00 1.000000e+00 2.729905e-03
";
const VELO_TO_CAM: &str = "calib_time: 15-Mar-2012 11:37:16
R: 7.533745e-03 -9.999714e-01 -6.166020e-04 1.480249e-02 7.280733e-04 -9.998902e-01 9.998621e-01 7.523790e-03 1.480755e-02
T: -4.069766e-03 -7.631618e-02 -2.717806e-01
delta_f: 0.000000e+00 0.000000e+00
";
const IMU_TO_VELO: &str = "calib_time: 25-May-2012 16:47:16
R: 9.999976e-01 7.553071e-04 -2.035826e-03 -7.854027e-04 9.998898e-01 -1.482298e-02 2.024406e-03 1.482454e-02 9.998881e-01
T: -8.086759e-01 3.195559e-01 -7.997231e-01
";

/// Stamps of a sensor that is `k` ms late.
fn stamps(k: usize) -> String {
    let lines: Vec<String> = (1..=4).map(|tenth| format!("2011-09-26 13:02:25.{tenth}{k:02}000000\n")).collect();
    lines.concat()
}

/// The first stamp of the LiDAR.
const FIRST_NANOS: i64 = 1_317_042_145_100_000_000;

/// A name, a function that damages the folder, and words of the error.
type Fault = (&'static str, fn(&Path), &'static str);

/// A record of the unit: latitude, longitude, height, yaw, then speeds north and east.
fn record([lat, lon, alt, yaw, vn, ve]: [f64; 6]) -> String {
    format!(
        "{lat:.13} {lon:.13} {alt} 0.03 -0.02 {yaw} {vn} {ve} 9 0.1 0.2 0.5 -0.25 9.81 0.51 -0.26 9.82 0.01 -0.02 0.125 0.011 \
         -0.021 0.126 0.05 0.014 4 9 6 6 6\n"
    )
}

/// Four sweeps, images and records, 0.9 m apart to the north-east.
fn drive(folder: &TempDir) -> PathBuf {
    let day = folder.path().join("2011_09_26");
    let raw = day.join("2011_09_26_drive_0001_sync");
    write_file(&day.join("calib_cam_to_cam.txt"), CAM_TO_CAM);
    write_file(&day.join("calib_velo_to_cam.txt"), VELO_TO_CAM);
    write_file(&day.join("calib_imu_to_velo.txt"), IMU_TO_VELO);
    for (sensor, late) in [("velodyne_points", 0), ("image_00", 1), ("image_02", 2), ("image_03", 3), ("oxts", 4)] {
        write_file(&raw.join(sensor).join("timestamps.txt"), stamps(late));
    }
    for k in 0..4 {
        write_file(
            &raw.join(format!("velodyne_points/data/{k:010}.bin")),
            [5.0_f32, 0.0, 0.0, 0.5].map(f32::to_le_bytes).concat(),
        );
        for camera in ["image_00", "image_02", "image_03"] {
            write_file(&raw.join(format!("{camera}/data/{k:010}.png")), png(1242, 375));
        }
        let values = [49.015 + 1e-5 * k as f64, 8.434 + 1e-5 * k as f64, 116.0, 0.9, 11.0, 7.3];
        write_file(&raw.join(format!("oxts/data/{k:010}.txt")), record(values));
    }
    raw
}

fn imported(import: &Import) -> (Vec<String>, Drive) {
    let report = import.run().expect("imports");
    (report, Drive::open(&import.out).expect("opens"))
}

#[test]
fn all_sensors_of_kitti_raw_are_imported() {
    let folder = folder();
    let import = import_from(drive(&folder), &folder);
    let (report, drive) = imported(&import);
    assert_eq!(
        report[1..],
        [
            "imported: 4 sweeps and their times",
            "imported: 4 images of camera image_02",
            "imported: 4 images of camera image_03",
            "imported: 4 records of oxts as GNSS fixes, IMU samples and true poses",
            "the body frame is the frame of the GNSS and IMU unit; heights are taken from its records",
            "not imported: 1 file in image_00 (camera images)",
            "not imported: 4 files in image_00/data (camera images)",
        ]
    );
    let stamp = |i: i64, late: i64| Stamp(FIRST_NANOS + (100 * i + late) * 1_000_000);
    let frames: Vec<(Stamp, usize)> = drive.camera_frames().iter().map(|frame| (frame.stamp, frame.camera)).collect();
    let expected: Vec<(Stamp, usize)> = (0..4).flat_map(|i| [(stamp(i, 2), 0), (stamp(i, 3), 1)]).collect();
    assert_eq!(frames, expected);
    assert!(drive.camera_frames().iter().all(|frame| frame.path.is_symlink()));

    let (fixes, stats) = drive.fixes().expect("reads");
    assert_eq!((fixes.len(), stats.bad_lines, stats.out_of_order), (4, 0, 0));
    let fix = &fixes[2];
    assert_eq!((fix.stamp, fix.quality, fix.satellites, fix.altitude_m), (stamp(2, 4), 4, 9, Some(116.0)));
    assert!((fix.position_deg[0] - 49.01502).abs() < 1e-8, "{fix:?}");
    assert!((fix.speed_mps.expect("has one") - 11.0_f64.hypot(7.3)).abs() < 1e-3, "{fix:?}");
    assert!((fix.course_deg.expect("has one") - 7.3_f64.atan2(11.0).to_degrees()).abs() < 0.01, "{fix:?}");
    let samples: Vec<_> = drive.imu().expect("opens").expect("has one").map(|sample| sample.expect("reads")).collect();
    assert_eq!((samples.len(), samples[1].stamp), (4, stamp(1, 4)));
    assert_eq!((samples[1].acceleration, samples[1].angular_rate), ([0.5, -0.25, 9.81], [0.01, -0.02, 0.125]));
}

/// The devkit projects a point of the LiDAR by `P_rect_xx R_rect_00 (R|T)_velo_to_cam`.
#[test]
fn points_of_kitti_raw_project_as_in_its_devkit() {
    let folder = folder();
    let (_, drive) = imported(&import_from(drive(&folder), &folder));
    let p = [12.0, 3.0, -0.75, 1.0];
    for (index, name) in ["P_rect_02", "P_rect_03"].into_iter().enumerate() {
        let in_camera_0 = rows(&numbers(VELO_TO_CAM, "R"), &numbers(VELO_TO_CAM, "T"), p);
        let rectified = rows(&numbers(CAM_TO_CAM, "R_rect_00"), &[0.0; 3], in_camera_0);
        let matrix = numbers(CAM_TO_CAM, name);
        let [u, v, w] = [0, 4, 8].map(|row| (0..4).map(|k| matrix[row + k] * rectified[k]).sum::<f64>());
        let camera = &drive.rig().cameras[index];
        let point = camera.body_from_camera.inverse() * drive.rig().body_from_lidar * Point3::new(p[0], p[1], p[2]);
        let pixel = camera.model.pixel_from_camera(&point).expect("is inside");
        assert!((pixel.x - u / w).abs() < 0.01 && (pixel.y - v / w).abs() < 0.01, "{name}: {pixel:?}, {u} {v} {w}");
    }
    // calib_imu_to_velo maps points of the unit to the LiDAR.
    let in_lidar = rows(&numbers(IMU_TO_VELO, "R"), &numbers(IMU_TO_VELO, "T"), [1.0, 2.0, 3.0, 1.0]);
    let back = drive.rig().body_from_lidar * Point3::new(in_lidar[0], in_lidar[1], in_lidar[2]);
    assert!((back - Point3::new(1.0, 2.0, 3.0)).norm() < 1e-5, "{back:?}");
}

fn numbers(text: &str, key: &str) -> Vec<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix(&format!("{key}: "))).expect("is there");
    line.split(' ').map(|word| word.parse().expect("a number")).collect()
}

fn rows(rotation: &[f64], translation: &[f64], p: [f64; 4]) -> [f64; 4] {
    let row = |k: usize| (0..3).map(|i| rotation[3 * k + i] * p[i]).sum::<f64>() + translation[k];
    [row(0), row(1), row(2), 1.0]
}

/// The devkit's convertOxtsToPose maps latitude and longitude by a Mercator projection of a sphere, which is accurate to
/// 0.3 % here.
#[test]
fn true_poses_of_kitti_raw_agree_with_the_mercator_projection_of_its_devkit() {
    let folder = folder();
    let (_, drive) = imported(&import_from(drive(&folder), &folder));
    let truth: Trajectory = drive.true_trajectory().expect("has one").expect("reads");
    let poses = truth.poses();
    assert_eq!(poses.len(), 4);
    let scale = 49.015_f64.to_radians().cos();
    let mercator = |lat: f64, lon: f64| {
        let x = scale * 6_378_137.0 * lon.to_radians();
        [x, scale * 6_378_137.0 * (std::f64::consts::FRAC_PI_4 + lat.to_radians() / 2.0).tan().ln()]
    };
    let [x0, y0] = mercator(49.015, 8.434);
    let [x, y] = mercator(49.01503, 8.43403);
    let end = poses[3].1.translation.vector;
    assert!((end.x - (x - x0)).abs() < 0.003 * (x - x0) && (end.y - (y - y0)).abs() < 0.003 * (y - y0), "{end:?}");
    assert!(end.x > 2.1 && end.y > 3.3, "{end:?}");
    // Yaw 0 is east; a positive pitch lowers the front, a positive roll raises the left side.
    let forward = poses[0].1.rotation * geometry::Vector3::x();
    let left = poses[0].1.rotation * geometry::Vector3::y();
    assert!((forward.y.atan2(forward.x) - 0.9).abs() < 1e-3 && (forward.z - 0.02).abs() < 1e-4, "{forward:?}");
    assert!((left.z - 0.03).abs() < 1e-4, "{left:?}");
}

#[test]
fn sweeps_that_the_data_set_lost_are_reported_and_the_others_keep_their_stamps() {
    let folder = folder();
    let raw = drive(&folder);
    std::fs::remove_file(raw.join("velodyne_points/data/0000000001.bin")).expect("removes");
    std::fs::remove_file(raw.join("image_03/data/0000000003.png")).expect("removes");
    let (report, drive) = imported(&import_from(raw, &folder));
    assert!(report.contains(&"1 of 4 stamps have no sweep".to_owned()), "{report:?}");
    assert!(report.contains(&"imported: 3 images of camera image_03; 1 stamps have no image".to_owned()), "{report:?}");
    let mut sweeps = drive.sweeps().expect("opens");
    let mut stamps = Vec::new();
    while let Some(sweep) = sweeps.next_sweep(|_| {}).expect("reads") {
        stamps.push((sweep.stamp.0 - FIRST_NANOS) / 1_000_000);
    }
    assert_eq!(stamps, [0, 200, 300]);
}

#[test]
fn damaged_kitti_raw_is_refused_with_file_and_rule() {
    let faults: [Fault; 11] = [
        (
            "no calibration",
            |raw| remove(&raw.join("../calib_cam_to_cam.txt")),
            "calib_cam_to_cam.txt is neither here nor",
        ),
        (
            "no unit calibration",
            |raw| remove(&raw.join("../calib_imu_to_velo.txt")),
            "calib_imu_to_velo.txt is neither",
        ),
        (
            "key",
            |raw| edit(&raw.join("../calib_cam_to_cam.txt"), "P_rect_03", "P_03"),
            "calib_cam_to_cam.txt: has no line P_rect_03:",
        ),
        (
            "word",
            |raw| edit(&raw.join("../calib_velo_to_cam.txt"), "-4.069766e-03", "x"),
            "calib_velo_to_cam.txt:3: T must be 3 finite",
        ),
        (
            "mirror",
            |raw| edit(&raw.join("../calib_velo_to_cam.txt"), "-9.999714e-01", "9.999714e-01"),
            "calib_velo_to_cam.txt:2: R: ",
        ),
        ("size", |raw| write_file(&raw.join("image_02/data/0000000000.png"), png(1392, 512)), "1392 x 512 px, but"),
        (
            "png",
            |raw| write_file(&raw.join("image_02/data/0000000000.png"), "GIF"),
            "0000000000.png: is neither a PNG nor a JPEG image",
        ),
        ("more images", |raw| write_file(&raw.join("image_02/data/0000000004.png"), ""), "has number 4, but"),
        (
            "nan",
            |raw| edit(&raw.join("oxts/data/0000000002.txt"), "-0.25", "nan"),
            "0000000002.txt: field 13, ay: \"nan\" must be",
        ),
        (
            "cut record",
            |raw| write_file(&raw.join("oxts/data/0000000003.txt"), "49 8 116"),
            "3 numbers; a record has 30: lat lon",
        ),
        (
            "no stamps",
            |raw| remove(&raw.join("velodyne_points/timestamps.txt")),
            "timestamps.txt: is absent; the sweeps need it",
        ),
    ];
    for (name, damage, rule) in faults {
        let folder = folder();
        let raw = drive(&folder);
        damage(&raw);
        let text = error(&import_from(raw, &folder));
        assert!(text.contains(rule), "{name}: {text}");
    }
}

#[test]
fn stamps_that_do_not_increase_are_refused_for_sweeps_and_left_out_for_records() {
    for (sensor, is_refused) in [("velodyne_points", true), ("image_02", true), ("oxts", false)] {
        let folder = folder();
        let raw = drive(&folder);
        let times = raw.join(sensor).join("timestamps.txt");
        let text = std::fs::read_to_string(&times).expect("reads");
        let lines: Vec<&str> = text.lines().collect();
        write_file(&times, [lines[0], lines[1], lines[1], lines[3]].join("\n"));
        let import = import_from(raw, &folder);
        if is_refused {
            let text = error(&import);
            assert!(text.contains("timestamps.txt:3: the stamp must be later than the stamp of 0000000001"), "{text}");
        } else {
            let report = import.run().expect("imports");
            let line = "not imported: 1 records of oxts whose stamp is not later than the previous one";
            assert!(report.iter().any(|found| found == line), "{report:?}");
            assert_eq!(Drive::open(&import.out).expect("opens").fixes().expect("reads").0.len(), 3);
        }
    }
}

#[test]
fn lidar_alone_needs_no_calibration() {
    let folder = folder();
    let raw = drive(&folder);
    remove(&raw.join("../calib_velo_to_cam.txt"));
    let mut import = import_from(raw, &folder);
    import.options.lidar_only = true;
    let (report, drive) = imported(&import);
    assert!(drive.manifest().cameras.is_empty() && drive.manifest().gnss.is_none() && drive.manifest().truth.is_none());
    assert!(report.contains(&"not imported: 4 files in oxts/data (GNSS and IMU)".to_owned()), "{report:?}");
}

fn remove(path: &Path) {
    std::fs::remove_file(path).expect("removes");
}

fn edit(path: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(path).expect("reads");
    assert!(text.contains(from), "{from}");
    write_file(path, text.replace(from, to));
}
