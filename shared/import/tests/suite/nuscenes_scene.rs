//! Imports of scenes of nuScenes with their tables, written in the published schema.

use super::support::{Import, error, first_label, folder, import_from, write_file};
use drive::{Drive, NoLabel};
use formats::cloud::CloudPoint;
use formats::kitti::labels_from_bytes;
use formats::nuscenes::bin_from_points;
use geometry::{Isometry3, Point3, Pose, UnitQuaternion, Vector3};
use messages::ClassId;
use serde_json::{Value, json};
use std::path::PathBuf;
use tempfile::TempDir;

const LOG: &str = "n015-2018-07-24-11-22-45+0800";
/// Start, µs.
const BEGIN: i64 = 1_532_402_927_000_000;

/// A name, a function that damages the tables, a folder to remove, and words of the error.
type Fault = (&'static str, fn(&mut DataSet), &'static str, &'static str);

/// Mounting of the LiDAR: x right, y forward.
fn body_from_lidar() -> Pose {
    let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -std::f64::consts::FRAC_PI_2);
    Isometry3::from_parts([0.94, 0.0, 1.84].into(), quarter)
}

/// Mounting of the front camera: z forward, y down.
fn body_from_camera() -> Pose {
    let turn = UnitQuaternion::from_quaternion(geometry::Quaternion::new(0.5, -0.5, 0.5, -0.5));
    Isometry3::from_parts([1.7, 0.016, 1.51].into(), turn)
}

/// Pose of the vehicle at a time, µs after the start: 10 m/s along a heading of 30 degrees.
fn world_from_body(micros: i64) -> Pose {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 30_f64.to_radians());
    let at = Vector3::new(400.0, 1180.0, 0.0) + turn * Vector3::x() * (1e-5 * micros as f64);
    Isometry3::from_parts(at.into(), turn)
}

fn quaternion(pose: &Pose) -> Value {
    let q = pose.rotation.coords;
    json!([q.w, q.x, q.y, q.z])
}

fn position(pose: &Pose) -> Value {
    json!(<[f64; 3]>::from(pose.translation.vector))
}

/// Tables and files of a folder of the data set.
struct DataSet {
    root: PathBuf,
    tables: Vec<(&'static str, Vec<Value>)>,
}

impl DataSet {
    fn new(folder: &TempDir) -> Self {
        let sensor = |token: &str, channel: &str| json!({"token": token, "channel": channel, "modality": "lidar"});
        let calibrated = |token: &str, pose: &Pose, intrinsic: Value| {
            json!({"token": format!("c-{token}"), "sensor_token": token, "translation": position(pose),
                   "rotation": quaternion(pose), "camera_intrinsic": intrinsic})
        };
        let lens = json!([[1266.4, 0.0, 816.3], [0.0, 1266.4, 491.5], [0.0, 0.0, 1.0]]);
        let sensors = vec![sensor("l", "LIDAR_TOP"), sensor("f", "CAM_FRONT"), sensor("r", "RADAR_FRONT")];
        let mut data = Self {
            root: folder.path().join("nuscenes"),
            tables: ["scene", "log", "sample", "sample_data", "ego_pose", "category", "instance", "sample_annotation"]
                .map(|name| (name, Vec::new()))
                .to_vec(),
        };
        data.tables.push(("sensor", sensors));
        data.tables.push((
            "calibrated_sensor",
            vec![
                calibrated("l", &body_from_lidar(), json!([])),
                calibrated("f", &body_from_camera(), lens),
                calibrated("r", &Pose::identity(), json!([])),
            ],
        ));
        data.add("log", json!({"token": "log", "logfile": LOG, "vehicle": "n015", "location": "singapore-onenorth"}));
        for name in ["vehicle.car", "flat.driveable_surface", "static.vegetation"] {
            let index = data.rows("category").len();
            data.add(
                "category",
                json!({"token": format!("k-{name}"), "name": name, "index": index, "description": ""}),
            );
        }
        data
    }

    fn rows(&mut self, table: &str) -> &mut Vec<Value> {
        &mut self.tables.iter_mut().find(|(name, _)| *name == table).expect("is there").1
    }

    fn add(&mut self, table: &str, row: Value) {
        self.rows(table).push(row);
    }

    /// A scene of two samples with a sweep between them; the rows of its files are not in the order of time.
    fn scene(&mut self, name: &str, begin: i64) {
        self.add("scene", json!({"token": format!("s-{name}"), "name": name, "log_token": "log", "nbr_samples": 2}));
        for (sample, micros) in [("b", 100_000), ("a", 0)] {
            let token = format!("{name}-{sample}");
            self.add(
                "sample",
                json!({"token": token, "scene_token": format!("s-{name}"), "timestamp": begin + micros}),
            );
            self.data(name, sample, "LIDAR_TOP", "l", begin + micros, true);
            self.data(name, sample, "CAM_FRONT", "f", begin + micros - 35_000, true);
            self.data(name, sample, "RADAR_FRONT", "r", begin + micros, true);
        }
        self.data(name, "a", "LIDAR_TOP", "l", begin + 50_000, false);
    }

    fn data(&mut self, scene: &str, sample: &str, channel: &str, sensor: &str, micros: i64, is_key_frame: bool) {
        let token = format!("{scene}-{channel}-{micros}");
        let folder = if is_key_frame { "samples" } else { "sweeps" };
        let (end, size) = if channel.starts_with("CAM") { ("jpg", [1600, 900]) } else { ("pcd.bin", [0, 0]) };
        let file = format!("{folder}/{channel}/{LOG}__{channel}__{micros}.{end}");
        let bytes = if channel == "LIDAR_TOP" { bin_from_points(&points()) } else { Vec::new() };
        write_file(&self.root.join(&file), bytes);
        let pose = world_from_body(micros - BEGIN);
        self.add(
            "ego_pose",
            json!({"token": token, "timestamp": micros, "translation": position(&pose), "rotation": quaternion(&pose)}),
        );
        self.add("sample_data", json!({
            "token": token, "sample_token": format!("{scene}-{sample}"), "ego_pose_token": token,
            "calibrated_sensor_token": format!("c-{sensor}"), "timestamp": micros, "fileformat": "pcd",
            "is_key_frame": is_key_frame, "width": size[0], "height": size[1], "filename": file, "prev": "", "next": ""
        }));
    }

    /// A car 10 m in front of the LiDAR at the second sample.
    fn boxed_car(&mut self, scene: &str) {
        let at = world_from_body(100_000) * Isometry3::translation(10.94, 0.0, 1.0);
        self.add("instance", json!({"token": "i-car", "category_token": "k-vehicle.car", "nbr_annotations": 1}));
        self.add("sample_annotation", json!({
            "token": "box", "sample_token": format!("{scene}-b"), "instance_token": "i-car", "translation": position(&at),
            "size": [2.0, 4.5, 3.0], "rotation": quaternion(&at), "num_lidar_pts": 1
        }));
    }

    fn segmentation(&mut self, scene: &str, ids: &[u8]) {
        let data = format!("{scene}-LIDAR_TOP-{}", BEGIN + 100_000);
        let file = format!("lidarseg/v1.0-mini/{data}_lidarseg.bin");
        write_file(&self.root.join(&file), ids);
        self.tables.push(("lidarseg", vec![json!({"token": "t", "sample_data_token": data, "filename": file})]));
    }

    fn write(&self) -> PathBuf {
        for (name, rows) in &self.tables {
            let text = serde_json::to_string(rows).expect("writes");
            write_file(&self.root.join(format!("v1.0-mini/{name}.json")), text);
        }
        self.root.clone()
    }
}

/// Points in the LiDAR frame: a car in front, a point that is not a return, the road on the right.
fn points() -> Vec<(CloudPoint, u8)> {
    let at = |x: f32, y: f32, z: f32| (CloudPoint { x, y, z, intensity: 20.0 }, 31);
    vec![at(0.3, 10.0, -1.0), at(0.0, 0.0, 0.0), at(5.0, 0.0, -1.84)]
}

/// Stamps of the sweeps, µs after the start.
fn stamps(drive: &Drive) -> Vec<i64> {
    let mut sweeps = drive.sweeps().expect("opens");
    let mut stamps = Vec::new();
    while let Some(sweep) = sweeps.next_sweep(|_| {}).expect("reads") {
        stamps.push(sweep.stamp.0 / 1000 - BEGIN);
    }
    stamps
}

fn imported(import: &Import) -> (Vec<String>, Drive) {
    let report = import.run().expect("imports");
    (report, Drive::open(&import.out).expect("opens"))
}

#[test]
fn scene_becomes_drive_with_cameras_and_poses() {
    let folder = folder();
    let mut data = DataSet::new(&folder);
    data.scene("scene-0061", BEGIN);
    let (report, drive) = imported(&import_from(data.write(), &folder));
    assert!(report[0].ends_with("3 sweeps of hdl32e (nuScenes)"), "{report:?}");
    assert!(report.contains(&"imported: 2 images of camera CAM_FRONT".to_owned()), "{report:?}");
    assert!(report.contains(&"imported: 5 true poses of ego_pose.json".to_owned()), "{report:?}");
    assert!(report.contains(&"not imported: 2 files in samples/RADAR_FRONT (radar)".to_owned()), "{report:?}");
    assert!(!report.iter().any(|line| line.starts_with("not imported") && line.contains("CAM_")), "{report:?}");
    assert_eq!(stamps(&drive), [0, 50_000, 100_000]);
    let images: Vec<i64> = drive.camera_frames().iter().map(|frame| frame.stamp.0 / 1000 - BEGIN).collect();
    assert_eq!(images, [-35_000, 65_000]);
    let truth = drive.true_trajectory().expect("has one").expect("reads");
    let at = truth.at(geometry::Stamp(1000 * (BEGIN + 50_000))).expect("is inside");
    assert!((at.inverse() * world_from_body(50_000)).translation.vector.norm() < 1e-9);

    // A point 10 m in front of the LiDAR: straight ahead of the vehicle, in the middle columns of the image.
    let in_body = drive.rig().body_from_lidar * Point3::new(0.0, 10.0, 0.0);
    assert!((in_body - Point3::new(10.94, 0.0, 1.84)).norm() < 1e-9, "{in_body:?}");
    let camera = &drive.rig().cameras[0];
    let pixel = camera.model.pixel_from_camera(&(camera.body_from_camera.inverse() * in_body)).expect("is inside");
    let expected = [816.3 + 1266.4 * 0.016 / 9.24, 491.5 - 1266.4 * 0.33 / 9.24];
    assert!((pixel.x - expected[0]).abs() < 1e-6 && (pixel.y - expected[1]).abs() < 1e-6, "{pixel:?} {expected:?}");
    assert_eq!(camera.model.size(), (1600, 900));
}

#[test]
fn sweeps_alone_have_the_stamps_of_the_tables() {
    let folder = folder();
    let mut data = DataSet::new(&folder);
    data.scene("scene-0061", BEGIN);
    let mut import = import_from(data.write(), &folder);
    import.options.lidar_only = true;
    let (_, drive) = imported(&import);
    assert_eq!(stamps(&drive), [0, 50_000, 100_000]);
}

#[test]
fn labels_of_segments_and_boxes_belong_to_their_key_frame() {
    let folder = folder();
    let mut data = DataSet::new(&folder);
    data.scene("scene-0061", BEGIN);
    data.boxed_car("scene-0061");
    data.segmentation("scene-0061", &[0, 0, 1]);
    let (report, drive) = imported(&import_from(data.write(), &folder));
    let line =
        "imported: labels of 1 key frames: classes of lidarseg and instances of the boxes; other sweeps have no labels";
    assert!(report.iter().any(|found| found == line), "{report:?}");
    assert!(!report.iter().any(|line| line.contains("lidarseg/")), "{report:?}");
    assert_eq!(labels(&drive, 2), [(ClassId::Vehicles as u16, 1), (ClassId::Road as u16, 0)]);
    assert!(!drive.folder().join("truth/labels/000000.label").exists());
    assert_eq!(first_label(&drive, 2).map(|label| label.class), Ok(ClassId::Vehicles as u8));
    assert_eq!(first_label(&drive, 1), Err(NoLabel::NoSweep), "the sweep between has no labels");
}

#[test]
fn boxes_alone_label_the_points_inside() {
    let folder = folder();
    let mut data = DataSet::new(&folder);
    data.scene("scene-0061", BEGIN);
    data.boxed_car("scene-0061");
    let (report, drive) = imported(&import_from(data.write(), &folder));
    assert!(report.iter().any(|line| line.contains("points outside are unlabeled")), "{report:?}");
    assert_eq!(labels(&drive, 2), [(ClassId::Vehicles as u16, 1), (ClassId::Unlabeled as u16, 0)]);
}

fn labels(drive: &Drive, seq: usize) -> Vec<(u16, u16)> {
    let bytes = std::fs::read(drive.folder().join(format!("truth/labels/{seq:06}.label"))).expect("reads");
    labels_from_bytes(&bytes).expect("reads").iter().map(|label| (label.class, label.instance)).collect()
}

#[test]
fn scene_or_log_is_chosen_among_several() {
    let folder = folder();
    let mut data = DataSet::new(&folder);
    data.scene("scene-0061", BEGIN);
    data.scene("scene-0103", BEGIN + 20_000_000);
    let mut import = import_from(data.write(), &folder);
    let text = error(&import);
    assert!(
        text.contains("2 scenes; choose one with --scene, or all of a drive with --log: scene-0061, scene-0103"),
        "{text}"
    );
    import.options.scene = Some("scene-9".into());
    assert!(error(&import).contains("--scene: no scene scene-9 in"), "{}", error(&import));
    import.options.scene = Some("scene-0103".into());
    let (_, drive) = imported(&import);
    assert_eq!((drive.sweep_files().len(), drive.manifest().name.as_str()), (3, "scene-0103 (nuScenes)"));
    std::fs::remove_dir_all(&import.out).expect("removes");
    import.options.scene = None;
    import.options.log = Some(LOG.into());
    let (report, drive) = imported(&import);
    assert_eq!(drive.sweep_files().len(), 6, "{report:?}");
}

#[test]
fn damaged_tables_are_refused_with_file_and_rule() {
    let faults: [Fault; 9] = [
        ("pose", |data| data.rows("ego_pose").clear(), "", "ego_pose.json: has no pose scene-0061-"),
        ("file", |_| (), "samples/CAM_FRONT", "2 of 5 files of the scene are absent, first samples/CAM_FRONT"),
        ("sensor", |data| data.rows("sensor").clear(), "", "calibrated_sensor.json: sensor l is not in sensor.json"),
        (
            "leaving",
            |data| data.rows("sample_data")[0]["filename"] = "../x.bin".into(),
            "",
            "filename \"../x.bin\" leaves the folder",
        ),
        (
            "rotation",
            |data| data.rows("calibrated_sensor")[0]["rotation"] = json!([1, 1, 0, 0]),
            "",
            "must be a unit quaternion w x y z",
        ),
        (
            "lens",
            |data| data.rows("calibrated_sensor")[1]["camera_intrinsic"] = json!([]),
            "",
            "CAM_FRONT: camera_intrinsic must be 3 rows",
        ),
        (
            "field",
            |data| data.rows("sample_data")[1] = json!({"token": "x"}),
            "",
            "sample_data.json: missing field `sample_token` at line 1",
        ),
        ("size", |data| data.segmentation("scene-0061", &[0; 2]), "", "_lidarseg.bin: 2 labels, but"),
        (
            "class",
            |data| data.segmentation("scene-0061", &[0, 0, 77]),
            "",
            "label 2 is 77, which category.json does not have",
        ),
    ];
    for (name, damage, removed, rule) in faults {
        let folder = folder();
        let mut data = DataSet::new(&folder);
        data.scene("scene-0061", BEGIN);
        damage(&mut data);
        let root = data.write();
        if !removed.is_empty() {
            std::fs::remove_dir_all(root.join(removed)).expect("removes");
        }
        let text = error(&import_from(root, &folder));
        assert!(text.contains(rule), "{name}: {text}");
    }
}

#[test]
fn cut_table_is_refused_at_each_length() {
    let folder = folder();
    let mut data = DataSet::new(&folder);
    data.scene("scene-0061", BEGIN);
    let root = data.write();
    let path = root.join("v1.0-mini/sample_data.json");
    let whole = std::fs::read(&path).expect("reads");
    for length in (0..whole.len()).step_by(97) {
        write_file(&path, &whole[..length]);
        let text = error(&import_from(&root, &folder));
        assert!(text.contains("sample_data.json: EOF while parsing"), "{length}: {text}");
    }
}

/// Tables of the real sample, made from its published calibration: points project as its published matrices require.
#[real_data::test("nuscenes")]
fn real_sample_projects_as_published() {
    let source = real_data::path("nuscenes");
    let text = std::fs::read_to_string(source.join("calib_and_boxes.json")).expect("reads");
    // The boxes have velocities of NaN, which is not JSON; they are not used here.
    let published: Value = serde_json::from_str(&text.replace("NaN", "null")).expect("parses");
    let folder = folder();
    let mut data = DataSet::new(&folder);
    data.scene("scene-0061", BEGIN);
    for table in ["scene", "sample", "sample_data", "ego_pose", "sensor", "calibrated_sensor"] {
        data.rows(table).clear();
    }
    std::fs::remove_dir_all(&data.root).expect("removes");
    data.add("scene", json!({"token": "s", "name": "scene-0061", "log_token": "log"}));
    data.add("sample", json!({"token": "sample", "scene_token": "s"}));
    let mut sensors = vec![("LIDAR_TOP", matrix(&published["lidar_points"]["lidar2ego"]), json!([]))];
    for (channel, camera) in published["images"].as_object().expect("an object") {
        sensors.push((channel, matrix(&camera["cam2ego"]), camera["cam2img"].clone()));
    }
    let names: Vec<String> = source
        .read_dir()
        .expect("lists")
        .map(|entry| entry.expect("lists").file_name().to_string_lossy().into())
        .collect();
    for (channel, pose, intrinsic) in &sensors {
        data.add("sensor", json!({"token": channel, "channel": channel}));
        data.add(
            "calibrated_sensor",
            json!({"token": channel, "sensor_token": channel, "translation": position(pose),
            "rotation": quaternion(pose), "camera_intrinsic": intrinsic}),
        );
        let name = names.iter().find(|name| name.contains(&format!("__{channel}__"))).expect("is there");
        let micros: i64 =
            name.split("__").nth(2).and_then(|end| end.split('.').next()).expect("a time").parse().expect("a number");
        let file = format!("samples/{channel}/{name}");
        write_file(&data.root.join(&file), std::fs::read(source.join(name)).expect("reads"));
        let ego = world_from_body(micros - BEGIN);
        data.add("ego_pose", json!({"token": channel, "translation": position(&ego), "rotation": quaternion(&ego)}));
        data.add(
            "sample_data",
            json!({"token": channel, "sample_token": "sample", "ego_pose_token": channel,
            "calibrated_sensor_token": channel, "timestamp": micros, "is_key_frame": true, "width": 1600, "height": 900,
            "filename": file}),
        );
    }
    let (_, drive) = imported(&import_from(data.write(), &folder));
    assert_eq!(drive.rig().cameras.len(), 6);
    for (entry, camera) in drive.manifest().cameras.iter().zip(&drive.rig().cameras) {
        let camera_from_lidar = camera.body_from_camera.inverse() * drive.rig().body_from_lidar;
        // The published matrix includes the motion of the vehicle between sweep and image, below 0.5 m and 2 degrees.
        let with_motion = matrix(&published["images"][&entry.name]["lidar2cam"]);
        let motion = with_motion.inverse() * camera_from_lidar;
        assert!(motion.translation.vector.norm() < 0.5, "{}: {motion:?}", entry.name);
        assert!(motion.rotation.angle().to_degrees() < 2.0, "{}: {motion:?}", entry.name);
    }
}

/// A rigid matrix of four rows.
fn matrix(rows: &Value) -> Pose {
    let number = |row: usize, column: usize| rows[row][column].as_f64().expect("a number");
    let line: Vec<String> = (0..12).map(|k| number(k / 4, k % 4).to_string()).collect();
    formats::trajectory::poses_from_kitti(&line.join(" ")).expect("is rigid")[0]
}
