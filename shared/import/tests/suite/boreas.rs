//! Imports of Boreas sequences, written by the tests in the published format.

use super::support::{Import, error, folder, import_from, png, write_file};
use drive::Drive;
use geometry::{CameraModel, Point3, Vector3};
use import::Kind;
use nalgebra::{Matrix3, Rotation3};
use std::path::PathBuf;
use tempfile::TempDir;

/// Middle of the first sweep, us.
const STAMP_US: i64 = 1_630_597_330_954_834;
const PERIOD_US: i64 = 100_000;
/// Rotation of the LiDAR about the vertical of the unit, above which it is mounted.
const LIDAR_YAW: f64 = 0.75;
const LIDAR_UP_M: f64 = 0.3;
/// Speed of the vehicle, m/s, and its direction, rad left of east.
const SPEED_MPS: f64 = 8.0;
const HEADING: f64 = 0.4;

/// Elevation of a laser, deg: not in the order of the numbers.
fn elevation_deg(laser: u32) -> f64 {
    f64::from(laser * 37 % 128) * 0.3125 - 25.0
}

/// Two points of each laser in ten columns, from 50 ms before to 40 ms after the stamp.
fn sweep() -> Vec<[f32; 6]> {
    let mut rows = Vec::new();
    for column in 0..10_u8 {
        for laser in 0..128 {
            for range_m in [20.0, 21.0] {
                let azimuth = -0.6 * f64::from(column);
                let elevation = elevation_deg(laser).to_radians();
                let level_m = range_m * elevation.cos();
                let position = [level_m * azimuth.cos(), level_m * azimuth.sin(), range_m * elevation.sin()];
                let [x, y, z] = position.map(|value| value as f32);
                rows.push([x, y, z, 17.0, laser as f32, 0.01 * f32::from(column) - 0.05]);
            }
        }
    }
    rows
}

fn bytes(rows: &[[f32; 6]]) -> Vec<u8> {
    rows.iter().flatten().flat_map(|value| value.to_le_bytes()).collect()
}

fn matrix(rotation: &Matrix3<f64>, translation: Vector3<f64>) -> String {
    let row = |k: usize| format!("{} {} {} {}\n", rotation[(k, 0)], rotation[(k, 1)], rotation[(k, 2)], translation[k]);
    (0..3).map(row).collect::<String>() + "0 0 0 1\n"
}

/// Axes of the LiDAR in the frame of the unit: x right, y forward, z up.
fn applanix_from_lidar() -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), LIDAR_YAW)
}

/// The vehicle drives straight ahead; the poses are poses of the LiDAR in UTM.
fn poses(n: i64) -> String {
    let header =
        "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,angvel_x\n";
    // Forward of the unit is its y axis.
    let world_from_applanix = Rotation3::from_axis_angle(&Vector3::z_axis(), HEADING - std::f64::consts::FRAC_PI_2);
    let world_from_lidar = world_from_applanix * applanix_from_lidar();
    // C1(roll) C2(pitch) C3(yaw), as in the development kit: rotations of the frame. Here the vehicle is level.
    let yaw = -world_from_lidar.matrix()[(1, 0)].atan2(world_from_lidar.matrix()[(0, 0)]);
    let line = |k: i64| {
        let s = SPEED_MPS * 1e-6 * (k * PERIOD_US) as f64;
        let [x, y] = [623_422.5 + s * HEADING.cos(), 4_848_820.25 + s * HEADING.sin()];
        let z = 153.5 + LIDAR_UP_M;
        format!("{},{x},{y},{z},0,0,0,0.0,0.0,{yaw},0,0,0\n", STAMP_US + k * PERIOD_US)
    };
    header.to_owned() + &(0..n).map(line).collect::<String>()
}

/// Raw samples at rest: x backward, y left, z down. `gravity` is measured along z.
fn imu(gravity: f64) -> String {
    let header = "GPSTime,angvel_z,angvel_y,angvel_x,accelz,accely,accelx\n";
    let line = |k: i64| format!("1630597330.9{k:02}500000,0.03,0.02,0.01,{gravity},0.2,0.1\n");
    header.to_owned() + &(0..50).map(line).collect::<String>()
}

fn sequence(folder: &TempDir) -> PathBuf {
    let root = folder.path().join("boreas-2021-09-02-11-42");
    for k in 0..3 {
        write_file(&root.join(format!("lidar/{}.bin", STAMP_US + k * PERIOD_US)), bytes(&sweep()));
    }
    for k in 0..2 {
        write_file(&root.join(format!("camera/{}.png", STAMP_US + 30_000 + k * PERIOD_US)), png(2448, 2048));
    }
    let up = Vector3::new(0.0, 0.0, LIDAR_UP_M);
    write_file(&root.join("calib/T_applanix_lidar.txt"), matrix(applanix_from_lidar().matrix(), up));
    // The camera looks forward: its x is right, y down, z forward, so its axes in the frame of the unit are x, -z, y.
    let applanix_from_camera = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0);
    let camera_from_lidar = applanix_from_camera.transpose() * applanix_from_lidar().matrix();
    write_file(&root.join("calib/T_camera_lidar.txt"), matrix(&camera_from_lidar, Vector3::new(0.0, -0.5, 0.0)));
    write_file(
        &root.join("calib/P_camera.txt"),
        "1475.5 0.0 1226.0 0.0\n0.0 1475.25 1031.5 0.0\n0.0 0.0 1.0 0.0\n0.0 0.0 0.0 1.0\n",
    );
    write_file(&root.join("applanix/lidar_poses.csv"), poses(3));
    write_file(&root.join("applanix/imu_raw.csv"), imu(-9.8));
    write_file(&root.join("applanix/imu.csv"), imu(0.0));
    write_file(&root.join("radar/1.png"), png(3, 3));
    root
}

fn imported(import: &Import) -> (Vec<String>, Drive) {
    let report = import.run().expect("imports");
    (report, Drive::open(&import.out).expect("opens"))
}

#[test]
fn sequence_of_boreas_is_recognized_and_taken() {
    let folder = folder();
    let root = sequence(&folder);
    assert_eq!(Kind::recognize(&root).expect("is known"), Kind::Boreas);
    let (report, drive) = imported(&import_from(&root, &folder));
    for line in [
        "imported: 3 sweeps and their times",
        "imported: 3 true poses of applanix/lidar_poses.csv",
        "imported: 50 IMU samples of applanix/imu_raw.csv",
        "imported: 2 images of camera front",
        "rings: 128 lasers counted not along the elevation",
        "not imported: 1 file in radar (radar)",
        "not imported: 1 file in applanix (GNSS and IMU)",
    ] {
        assert!(report.iter().any(|found| found == line), "{line}: {report:?}");
    }
    assert_eq!(report.iter().filter(|line| line.starts_with("not imported")).count(), 2, "{report:?}");

    let mut sweeps = drive.sweeps().expect("opens");
    let mut n_sweeps = 0;
    let mut returns = Vec::new();
    while let Some(sweep) = sweeps.next_sweep(|some| returns.extend_from_slice(some)).expect("reads") {
        // Times count from the middle of the revolution. An f32 of 50 ms resolves 4 ns.
        let late_nanos = sweep.stamp.0 - (STAMP_US + n_sweeps * PERIOD_US - 50_000) * 1000;
        assert!(sweep.has_times && late_nanos.abs() <= 4, "{late_nanos} ns");
        n_sweeps += 1;
    }
    assert_eq!((n_sweeps, returns.len()), (3, 3 * 2560));
    for (found, row) in returns.iter().zip(sweep().iter()) {
        assert_eq!([found.x, found.y, found.z], [row[0], row[1], row[2]]);
        let offset_ms = f64::from(found.offset_nanos) * 1e-6;
        assert!((offset_ms - f64::from(row[5] + 0.05) * 1e3).abs() < 1e-4, "{offset_ms}");
        assert_eq!(u32::from(found.ring), row[4] as u32 * 37 % 128, "0 is the lowest beam");
    }
}

#[test]
fn poses_camera_and_imu_are_in_a_body_frame_with_x_forward() {
    let folder = folder();
    let root = sequence(&folder);
    let (_, drive) = imported(&import_from(&root, &folder));
    let truth = drive.true_trajectory().expect("has one").expect("reads");
    let [first, .., last] = truth.poses() else { panic!("{} poses", truth.poses().len()) };
    assert_eq!(first.0.0, STAMP_US * 1000);
    assert!(first.1.translation.vector.norm() < 1e-6, "the world begins at the first pose");
    // It drives along its x axis, and its z axis is up.
    let travel = last.1.translation.vector;
    assert!((travel - last.1.rotation * Vector3::new(SPEED_MPS * 0.2, 0.0, 0.0)).norm() < 1e-6, "{travel}");
    assert!((travel - Vector3::new(HEADING.cos(), HEADING.sin(), 0.0) * SPEED_MPS * 0.2).norm() < 1e-6, "{travel}");
    assert!((last.1.rotation * Vector3::z() - Vector3::z()).norm() < 1e-9);

    let rig = drive.rig();
    assert!((rig.body_from_lidar.translation.vector - Vector3::new(0.0, 0.0, LIDAR_UP_M)).norm() < 1e-9);
    let camera = &rig.cameras[0];
    // The optical axis is forward, the row axis right.
    assert!((camera.body_from_camera.rotation * Vector3::z() - Vector3::x()).norm() < 1e-9);
    assert!((camera.body_from_camera.rotation * Vector3::x() + Vector3::y()).norm() < 1e-9);
    // A point of the LiDAR is half a meter higher in the camera: y is down.
    let p_in_camera = camera.body_from_camera.inverse() * rig.body_from_lidar * Point3::origin();
    assert!((p_in_camera - Point3::new(0.0, -0.5, 0.0)).norm() < 1e-9, "{p_in_camera}");
    let CameraModel::Pinhole(lens) = &camera.model else { panic!("{:?}", camera.model) };
    assert_eq!([lens.fx, lens.fy, lens.cx, lens.cy], [1475.5, 1475.25, 1226.0, 1031.5]);
    assert_eq!((lens.width, lens.height), (2448, 2048));
    let stamps: Vec<i64> = drive.camera_frames().iter().map(|frame| frame.stamp.0 / 1000).collect();
    assert_eq!(stamps, [STAMP_US + 30_000, STAMP_US + 30_000 + PERIOD_US]);

    let samples: Vec<_> = drive.imu().expect("opens").expect("has one").map(|sample| sample.expect("reads")).collect();
    assert_eq!((samples.len(), samples[7].stamp.0), (50, 1_630_597_330_907_500_000));
    let near = |found: [f64; 3], expected: [f64; 3]| (0..3).all(|k| (found[k] - expected[k]).abs() < 1e-9);
    assert!(near(samples[0].acceleration, [-0.1, 0.2, 9.8]), "{:?}", samples[0]);
    assert!(near(samples[0].angular_rate, [-0.01, 0.02, -0.03]), "{:?}", samples[0]);
}

#[test]
fn imu_without_gravity_or_with_other_axes_is_left_with_the_reason() {
    for (gravity, rule) in [
        (0.0, "accelerations have a median of 0.2"),
        (9.8, "the mean acceleration is 0.1 0.2 9.8 m/s^2; with z down it must be about 0 0 -9.8"),
    ] {
        let folder = folder();
        let root = sequence(&folder);
        write_file(&root.join("applanix/imu_raw.csv"), imu(gravity));
        let (report, drive) = imported(&import_from(&root, &folder));
        let line = format!("not imported: applanix/imu_raw.csv: {rule}");
        assert!(report.iter().any(|found| found.starts_with(&line)), "{line}: {report:?}");
        assert_eq!(drive.manifest().imu, None);
    }
}

#[test]
fn sweeps_alone_need_no_calibration() {
    let folder = folder();
    let root = sequence(&folder);
    std::fs::remove_dir_all(root.join("calib")).expect("removes");
    let mut import = import_from(&root, &folder);
    assert!(error(&import).contains("T_applanix_lidar.txt: is absent; poses, images and the IMU need it"));
    import.options.lidar_only = true;
    let (report, drive) = imported(&import);
    assert!(report.iter().any(|line| line == "not imported: 3 files in applanix (GNSS and IMU)"), "{report:?}");
    let manifest = drive.manifest();
    assert!(manifest.cameras.is_empty() && manifest.imu.is_none() && manifest.truth.is_none());
    assert_eq!(drive.rig().body_from_lidar.translation.vector.norm(), 0.0);
}

#[test]
fn files_that_do_not_fit_are_refused_with_file_and_rule() {
    let name = format!("lidar/{STAMP_US}.bin");
    let mut late = sweep();
    late[300][5] = 0.3;
    let mut laser = sweep();
    laser[7][4] = 3.5;
    let mut many = sweep();
    for row in &mut many {
        row[4] += 1.0;
    }
    let mut far = sweep();
    far[9][0] = 400.0;
    let pose = |line: &str| (poses(1) + line).into_bytes();
    let faults: [(&str, Vec<u8>, &str); 14] = [
        (name.as_str(), Vec::new(), "0 bytes must be rows of 24 bytes"),
        (name.as_str(), vec![0; 25], "25 bytes must be rows of 24 bytes"),
        (name.as_str(), bytes(&late), "point 300: the time is 0.3; it must be 0.25 s or less"),
        (name.as_str(), bytes(&laser), "point 7: the laser is 3.5; it must be a number from 0 to 255"),
        (name.as_str(), bytes(&far), "point 9"),
        ("lidar/first.bin", bytes(&sweep()), "first.bin: the name must be the stamp, us since 1970"),
        ("calib/T_applanix_lidar.txt", b"1 0 0 0\n".to_vec(), "must be a matrix of four rows, the last one 0 0 0 1"),
        ("calib/T_camera_lidar.txt", b"1 0 x 0\n".to_vec(), "T_camera_lidar.txt:1: must be four finite numbers"),
        ("calib/T_camera_lidar.txt", b"2 0 0 0\n0 2 0 0\n0 0 2 0\n0 0 0 1\n".to_vec(), "not a rotation"),
        ("calib/P_camera.txt", b"9 1 0 0\n0 9 0 0\n0 0 1 0\n".to_vec(), "must be the projection of a rectified camera"),
        ("applanix/lidar_poses.csv", b"GPSTime,easting\n".to_vec(), "lidar_poses.csv:1: has no column northing"),
        ("applanix/lidar_poses.csv", pose("x,0,0,0,0,0,0,0,0,0,0,0,0\n"), "lidar_poses.csv:3: GPSTime is \"x\""),
        (
            "applanix/lidar_poses.csv",
            pose("1630597331954834,0,0,0,0,0,0,nan,0,0,0,0,0\n"),
            "lidar_poses.csv:3: roll is \"nan\"; it must be a number",
        ),
        (
            "applanix/lidar_poses.csv",
            pose("1630597330954834,0,0,0,0,0,0,0,0,0,0,0,0\n"),
            "GPSTime is \"1630597330954834\"; it must be later than in the previous line",
        ),
    ];
    for (file, bytes, rule) in faults {
        let folder = folder();
        let root = sequence(&folder);
        write_file(&root.join(file), bytes);
        let text = error(&import_from(&root, &folder));
        assert!(text.contains(rule), "{rule}: {text}");
    }
    // Laser numbers from 1 to 128 are not rings of an Alpha Prime.
    let folder = folder();
    let root = sequence(&folder);
    for k in 0..3 {
        write_file(&root.join(format!("lidar/{}.bin", STAMP_US + k * PERIOD_US)), bytes(&many));
    }
    let (report, _) = imported(&import_from(&root, &folder));
    assert!(report.iter().any(|line| line.starts_with("no rings: ")), "{report:?}");
}
