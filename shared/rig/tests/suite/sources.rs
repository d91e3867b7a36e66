//! Third-party calibrations.

use formats::ladybug::LadybugCalibration;
use geometry::{CameraModel, Point3, Vector3};
use rig::source::{FrameTree, RigParts, SourceOptions, read};
use std::fs;
use std::path::Path;

fn written(name: &str, text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, text).expect("writes");
    (folder, path)
}

fn read_alone(path: &Path, options: &SourceOptions) -> Result<RigParts, String> {
    read(path, options, &mut FrameTree::default()).map_err(|error| error.to_string())
}

#[real_data::test("ladybug5/ladybug16146039-20m.cal")]
fn factory_calibration_of_a_ladybug_gives_six_cameras() {
    let path = &real_data::path("ladybug5/ladybug16146039-20m.cal");
    let parts = read_alone(path, &SourceOptions::default()).expect("reads");
    let text = fs::read_to_string(path).expect("reads");
    let file: LadybugCalibration = text.parse().expect("reads");
    assert_eq!(parts.cameras.len(), 6);
    for (part, camera) in parts.cameras.iter().zip(file.cameras) {
        assert_eq!(part.body_from_camera, Some(camera.ladybug_from_camera));
    }
}

const KALIBR: &str = "\
cam0:
  T_cam_imu:
  - [0.0, -1.0, 0.0, 0.01]
  - [0.0, 0.0, -1.0, 0.02]
  - [1.0, 0.0, 0.0, 0.03]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.01, 0.002, 0.0, 0.0]
  distortion_model: equidistant
  intrinsics: [380.0, 381.0, 510.0, 400.0]
  resolution: [1024, 800]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.0025
cam1:
  T_cam_imu:
  - [0.0, -1.0, 0.0, -0.09]
  - [0.0, 0.0, -1.0, 0.02]
  - [1.0, 0.0, 0.0, 0.03]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [-0.3, 0.1, 0.001, 0.0005]
  distortion_model: radtan
  intrinsics: [458.0, 457.0, 367.0, 248.0]
  resolution: [752, 480]
";

#[test]
fn chain_of_kalibr_is_mounted_at_the_inertial_unit() {
    let (_folder, path) = written("camchain-imucam.yaml", KALIBR);
    let parts = read_alone(&path, &SourceOptions::default()).expect("reads");
    assert_eq!(parts.body_from_imu, Some(geometry::Pose::identity()));
    let [first, second] = &parts.cameras[..] else { panic!("{parts:?}") };
    let pose = first.body_from_camera.expect("mounted");
    // The optical axis of the camera is the x axis of the unit.
    assert!((pose * Vector3::z() - Vector3::x()).norm() < 1e-9);
    assert!((pose * Point3::new(0.01, 0.02, 0.03)).coords.norm() < 1e-9);
    assert!(matches!(first.model, CameraModel::KannalaBrandt(_)) && matches!(second.model, CameraModel::Pinhole(_)));
    assert!(parts.notes[0].contains("-2.50 ms late"), "{:?}", parts.notes);
    let apart = pose.translation.vector - second.body_from_camera.expect("mounted").translation.vector;
    assert!((apart.norm() - 0.1).abs() < 1e-9);

    let error = |text: &str| {
        let (_folder, path) = written("camchain.yaml", text);
        read_alone(&path, &SourceOptions::default()).expect_err("refused")
    };
    assert!(
        error(&KALIBR.replace("camera_model: pinhole", "camera_model: omni")).contains("\"omni\" is not supported")
    );
    let mirrored = KALIBR.replace("- [0.0, -1.0, 0.0, 0.01]", "- [0.0, 1.0, 0.0, 0.01]");
    assert!(error(&mirrored).contains("mirrors one axis"), "{}", error(&mirrored));
    assert!(error(&KALIBR.replace("[1024, 800]", "[1024]")).contains("line 2: 1 numbers of resolution"));
}

#[test]
fn tree_and_camera_info_of_ros_are_joined() {
    let tree_text = "\
transforms:
- header: {frame_id: base_link}
  child_frame_id: velodyne
  transform: {translation: {x: 1.0, y: 0.0, z: 1.8}, rotation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}}
- header: {frame_id: base_link}
  child_frame_id: front_optical
  transform: {translation: {x: 1.5, y: 0.0, z: 1.5}, rotation: {x: -0.5, y: 0.5, z: -0.5, w: 0.5}}
---
";
    let camera_text = "\
image_width: 640
image_height: 480
camera_name: front_optical
camera_matrix:
  rows: 3
  cols: 3
  data: [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.2, 0.05, 0.0, 0.0, 0.0]}
";
    let (_a, tree_path) = written("tf.yaml", tree_text);
    let (_b, camera_path) = written("front.yaml", camera_text);
    let options = SourceOptions::default();
    let mut tree = FrameTree::default();
    let mut parts = read(&tree_path, &options, &mut tree).expect("reads");
    parts.merge(read(&camera_path, &options, &mut tree).expect("reads"));
    parts.mount(&tree, &options).expect("connected");
    let camera = &parts.cameras[0];
    let pose = camera.body_from_camera.expect("mounted");
    assert!((pose * Vector3::z() - Vector3::x()).norm() < 1e-9, "it looks ahead");
    assert_eq!(parts.body_from_lidar.map(|pose| pose.translation.z), Some(1.8));
    let lidar = drive::manifest::LidarEntry::from_captures("vlp16", parts.body_from_lidar.expect("mounted").into());
    let manifest = parts.manifest("a street", lidar, None).expect("complete");
    let text = toml::to_string(&manifest).expect("TOML");
    assert_eq!(toml::from_str::<drive::manifest::Manifest>(&text).expect("reads"), manifest);
}

#[test]
fn kitti_odometry_projects_the_point_ahead_to_the_middle() {
    let calib = "\
P0: 7.188560000000e+02 0.0 6.071928000000e+02 0.0 0.0 7.188560000000e+02 1.852157000000e+02 0.0 0.0 0.0 1.0 0.0
P2: 7.188560000000e+02 0.0 6.071928000000e+02 4.538225000000e+01 0.0 7.188560000000e+02 1.852157000000e+02 -1.130887000000e-01 0.0 0.0 1.0 3.779761000000e-03
Tr: 4.276802385584e-04 -9.999672484946e-01 -8.084491683471e-03 -1.198459927713e-02 -7.210626507497e-03 8.081198471645e-03 -9.999413164504e-01 -5.403984729748e-02 9.999738645903e-01 4.859485810390e-04 -7.206933692422e-03 -2.921968648686e-01
";
    let (folder, _) = written("calib.txt", calib);
    let error = read_alone(folder.path(), &SourceOptions::default()).expect_err("no size");
    assert!(error.contains("--image-size W,H"), "{error}");
    let options = SourceOptions { image_size: Some([1241, 376]), ..SourceOptions::default() };
    let parts = read_alone(folder.path(), &options).expect("reads");
    let camera = &parts.cameras[1];
    assert_eq!(camera.name, "color_left");
    let pose = camera.body_from_camera.expect("mounted");
    // The color camera is 6 cm to the left of the gray one, which is 27 cm ahead of the LiDAR.
    assert!((pose.translation.vector - Vector3::new(0.29, 0.05, -0.06)).norm() < 0.03, "{pose}");
    let pixel = camera.model.pixel_from_camera(&(pose.inverse() * Point3::new(30.0, 0.0, 0.0))).expect("in view");
    assert!((pixel.x - 607.0).abs() < 15.0 && (pixel.y - 185.0).abs() < 15.0, "{pixel}");
}

#[real_data::test("kitti00/calib_Tr_velo_to_cam0.txt", "kitti00/000094.bin")]
fn real_transform_of_kitti_puts_the_points_ahead_into_the_image() {
    let transform = fs::read_to_string(real_data::path("kitti00/calib_Tr_velo_to_cam0.txt")).expect("reads");
    let projection = "P0: 718.856 0 607.1928 0 0 718.856 185.2157 0 0 0 1 0";
    let (folder, _) = written("calib.txt", &format!("{projection}\n{transform}"));
    let options = SourceOptions { image_size: Some([1241, 376]), ..SourceOptions::default() };
    let parts = read_alone(folder.path(), &options).expect("reads");
    let camera = &parts.cameras[0];
    let camera_from_body = camera.body_from_camera.expect("mounted").inverse();
    let sweep = fs::read(real_data::path("kitti00/000094.bin")).expect("reads");
    let points = formats::kitti::points_from_bin(&sweep).expect("decodes");
    let ahead = points.iter().filter(|p| p.x > 5.0 && (p.y / p.x).abs() < 0.7 && (-0.2..0.1).contains(&(p.z / p.x)));
    let pixels: Vec<bool> = ahead
        .map(|p| Point3::new(f64::from(p.x), f64::from(p.y), f64::from(p.z)))
        .map(|p| camera.model.pixel_from_camera(&(camera_from_body * p)).is_some())
        .collect();
    let n_inside = pixels.iter().filter(|is_inside| **is_inside).count();
    assert!(pixels.len() > 10_000 && n_inside * 100 > pixels.len() * 99, "{n_inside} of {}", pixels.len());
}

#[test]
fn nuscenes_needs_a_log_if_several_are_calibrated() {
    let sensors = r#"[{"token": "s0", "channel": "LIDAR_TOP", "modality": "lidar"}, {"token": "s1", "channel": "CAM_FRONT", "modality": "camera"},
        {"token": "s2", "channel": "RADAR_FRONT", "modality": "radar"}]"#;
    let entry = |token: &str, sensor: &str, intrinsics: &str| {
        format!(
            r#"{{"token": "{token}", "sensor_token": "{sensor}", "translation": [1.7, 0.0, 1.5], "rotation": [0.5, -0.5, 0.5, -0.5], "camera_intrinsic": {intrinsics}}}"#
        )
    };
    let matrix = "[[1266.4, 0.0, 816.3], [0.0, 1266.4, 491.5], [0.0, 0.0, 1.0]]";
    let entries =
        [entry("c0", "s0", "[]"), entry("c1", "s1", matrix), entry("c2", "s2", "[]"), entry("c3", "s1", matrix)];
    let (folder, path) = written("calibrated_sensor.json", &format!("[{}]", entries.join(", ")));
    fs::write(folder.path().join("sensor.json"), sensors).expect("writes");
    let error = read_alone(&path, &SourceOptions::default()).expect_err("two cameras");
    assert!(error.contains("2 calibrations of CAM_FRONT; give --log"), "{error}");
    let rows =
        ["LIDAR_TOP/n1__LIDAR_TOP__1.bin c0", "CAM_FRONT/n1__CAM_FRONT__1.jpg c1", "CAM_FRONT/n2__CAM_FRONT__1.jpg c3"];
    let rows = rows.map(|row| {
        let (name, token) = row.split_once(' ').expect("two words");
        format!(r#"{{"filename": "samples/{name}", "calibrated_sensor_token": "{token}", "is_key_frame": true}}"#)
    });
    fs::write(folder.path().join("sample_data.json"), format!("[{}]", rows.join(","))).expect("writes");
    let options = SourceOptions { log: Some("n1".into()), ..SourceOptions::default() };
    let parts = read_alone(&path, &options).expect("reads");
    assert!(parts.body_from_lidar.is_some() && parts.cameras.len() == 1, "{parts:?}");
    let pose = parts.cameras[0].body_from_camera.expect("mounted");
    assert!((pose * Vector3::z() - Vector3::x()).norm() < 1e-9);
}

#[test]
fn damaged_files_are_refused_with_their_place() {
    for (name, text, expected) in [
        ("a.yaml", "a: [1, 2\n", "line "),
        ("a.yaml", "speed: 3\n", "its keys are speed"),
        ("a.yaml", "", "is empty"),
        ("a.json", "[{\"token\": 3", "line 1"),
        ("a.cal", "hello\n", "not a Ladybug calibration"),
        ("a.txt", "hello\n", "not a known calibration"),
        ("a.yaml", "K: [1, 2, 3]\nimage_width: 4\nimage_height: 4\n", "line 1: 3 numbers; must be 9"),
    ] {
        let (_folder, path) = written(name, text);
        let error = read_alone(&path, &SourceOptions::default()).expect_err("refused");
        assert!(error.contains(expected), "{name} {text:?}: {error}");
    }
}
