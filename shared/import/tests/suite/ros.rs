//! Imports of the bags that `tests/bags/make_bags.py` wrote with the Python package rosbags.

use super::support::{Import, folder, import_from};
use drive::{Drive, SweepInfo};
use geometry::{CameraModel, Vector3};
use lidar::SweepPoint;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const BEGIN: i64 = 1_700_000_000_000_000_000;
const TURN: i64 = 100_000_000;
const BEAMS: usize = 16;
const COLUMNS: usize = 8;

pub fn bag(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bags").join(name)
}

/// The bag `street` in all containers.
pub const STREETS: [&str; 6] =
    ["street.bag", "street_bz2.bag", "street_lz4.bag", "street_sqlite", "street_mcap", "street_zstd"];

fn imported(name: &str, folder: &TempDir) -> (Import, Vec<String>, Drive) {
    let import = import_from(bag(name), folder);
    let report = import.run().unwrap_or_else(|error| panic!("{name}: {error}"));
    let drive = Drive::open(&import.out).expect("opens");
    (import, report, drive)
}

fn sweeps(drive: &Drive) -> Vec<(SweepInfo, Vec<SweepPoint>)> {
    let mut source = drive.sweeps().expect("opens");
    let mut found = Vec::new();
    let mut points = Vec::new();
    while let Some(info) = source.next_sweep(|piece| points.extend_from_slice(piece)).expect("reads") {
        found.push((info, std::mem::take(&mut points)));
    }
    assert_eq!(source.damage(), <[String; 0]>::default());
    found
}

/// Beam, column and time after the start of the revolution of a point, from its direction and range.
fn fired(point: &SweepPoint) -> (usize, usize, i64) {
    let range_m = point.x.hypot(point.y).hypot(point.z);
    let beam = 0.5 * ((point.z / range_m).asin().to_degrees() + 15.0);
    let column = (range_m - 10.0) / 0.5;
    assert!((beam - beam.round()).abs() < 1e-3 && (column - column.round()).abs() < 1e-3, "{point:?}");
    let beam = beam.round() as usize;
    let column = column.round() as usize;
    (beam, column, column as i64 * (TURN / COLUMNS as i64) + beam as i64 * 2000)
}

/// Checks the three revolutions. `off_nanos`: largest error of a time; `None` without times. `missing`: missing returns.
fn check_sweeps(
    drive: &Drive,
    off_nanos: Option<i64>,
    has_rings: bool,
    has_intensity: bool,
    missing: &[(usize, usize)],
) {
    let found = sweeps(drive);
    assert_eq!(found.len(), 3);
    for (number, (info, points)) in found.iter().enumerate() {
        let begin = BEGIN + number as i64 * TURN;
        assert!((info.stamp.0 - begin).abs() <= off_nanos.unwrap_or(0), "{info:?}");
        assert_eq!((info.has_times, points.len()), (off_nanos.is_some(), BEAMS * COLUMNS - missing.len()));
        assert!(points.is_sorted_by_key(|point| point.offset_nanos));
        for point in points {
            let (beam, column, time) = fired(point);
            let expected = off_nanos.map_or(0, |_| time);
            let off = info.stamp.0 + i64::from(point.offset_nanos) - begin - expected;
            assert!(off.abs() <= off_nanos.unwrap_or(0), "{point:?}: {off} ns");
            assert!(!missing.contains(&(beam, column)), "{point:?}");
            assert_eq!(usize::from(point.ring), if has_rings { beam } else { 0 }, "{point:?}");
            assert_eq!(usize::from(point.intensity), if has_intensity { 10 * column } else { 0 }, "{point:?}");
        }
    }
}

/// Content of all files below a folder, without the name of the drive.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(at) = folders.pop() {
        for entry in at.read_dir().expect("lists") {
            let path = entry.expect("lists").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let mut bytes = std::fs::read(&path).expect("reads");
            if path.ends_with("drive.toml") {
                let text = String::from_utf8(bytes).expect("is text");
                bytes = text.lines().filter(|line| !line.starts_with("name = \"street")).collect::<String>().into();
            }
            found.insert(path.strip_prefix(folder).expect("is below").to_owned(), bytes);
        }
    }
    found
}

#[test]
fn bags_of_all_containers_become_the_same_drive() {
    let folder = folder();
    let mut first = None;
    // Files or messages compressed as a whole; two files that follow each other against the order of their names.
    for name in STREETS.into_iter().chain(["street_file", "street_message", "street_split"]) {
        let mut import = import_from(bag(name), &folder);
        import.out = folder.path().join(format!("{name}.drive"));
        let report = import.run().unwrap_or_else(|error| panic!("{name}: {error}"));
        let found = (files(&import.out), report[1..].to_vec());
        assert_eq!(found.0.len(), 3 + 1 + 3 + 1 + 1 + 1, "{name}: {:?}", found.0.keys());
        let first = first.get_or_insert_with(|| found.clone());
        assert!(*first == found, "{name} differs");
    }
}

#[test]
fn ros1_bag_becomes_a_drive_with_all_sensors_and_lists_the_rest() {
    let folder = folder();
    let (import, report, drive) = imported("street.bag", &folder);
    assert_eq!(report[0], format!("{}: 3 sweeps of vlp16 (ROS bag)", import.out.display()));
    assert_eq!(
        report[1..],
        [
            "imported: 3 sweeps from /velodyne_points",
            "point times: field time, s from the stamp",
            "rings: field ring, 16 beams counted from the lowest",
            "clouds do not name the LiDAR: vlp16 is assumed, --model sets another",
            "the body frame is \"base_link\"",
            "imported: 3 images from /cam/image_raw",
            "exposure times are not in the bag: stamps are taken as the middle of exposures of 1 ms; set exposure_nanos in drive.toml",
            "imported: 6 IMU samples from /imu/data",
            "imported: 3 fixes from /fix, without speeds",
            "fixes of /fix without a position: 1",
            "3 messages of /cam/image_raw have no stamp: the times at which they were received are taken",
            "not imported: 1 message of /chatter (std_msgs/String)",
        ]
    );
    // f32 seconds of a tenth of a second.
    check_sweeps(&drive, Some(8), true, true, &[]);
    let rig = drive.rig();
    assert!((rig.body_from_lidar.translation.vector - Vector3::new(0.5, 0.0, 1.9)).norm() < 1e-12);
    let camera = &rig.cameras[0];
    assert!((camera.body_from_camera.translation.vector - Vector3::new(0.7, 0.0, 1.0)).norm() < 1e-12);
    assert!((camera.body_from_camera.rotation * Vector3::z() - Vector3::x()).norm() < 1e-12);
    let CameraModel::Pinhole(lens) = &camera.model else { panic!("not a pinhole") };
    assert_eq!((lens.fx, lens.fy, lens.cx, lens.cy), (8.0, 8.5, 3.5, 2.5));
    assert_eq!(lens.distortion, [-0.1, 0.02, 0.001, -0.001, 0.0]);
    let stamps: Vec<i64> = drive.camera_frames().iter().map(|frame| frame.stamp.0 - BEGIN).collect();
    assert_eq!(stamps, [TURN + 1, 2 * TURN + 1, 3 * TURN + 1]);
    for frame in drive.camera_frames() {
        let image = image::open(&frame.path).expect("is an image").to_rgb8();
        assert_eq!(image.dimensions(), (8, 6));
        assert!(image.pixels().all(|pixel| pixel.0 == [200, 100, 50]));
    }
    let samples: Vec<_> =
        drive.imu().expect("opens").expect("has one").map(|sample| sample.expect("is valid")).collect();
    assert_eq!(samples.len(), 6);
    for (number, sample) in samples.iter().enumerate() {
        // The unit hangs upside down.
        let [rate, acceleration] = [sample.angular_rate, sample.acceleration].map(Vector3::from);
        assert_eq!(sample.stamp.0, BEGIN + number as i64 * 10_000_000);
        assert!((rate - Vector3::new(0.01, -0.02, -0.03 - number as f64)).norm() < 1e-9, "{sample:?}");
        assert!((acceleration - Vector3::new(0.1, -0.2, -9.81)).norm() < 1e-9, "{sample:?}");
    }
    let gnss = drive.manifest().gnss.as_ref().expect("has one");
    assert_eq!(gnss.antenna_in_body, [-0.4, 0.0, 1.5]);
    let (fixes, stats) = drive.fixes().expect("reads");
    assert_eq!((fixes.len(), stats.without_fix, stats.bad_lines), (3, 1, 0));
    for (fix, number) in fixes.iter().zip(1..) {
        let off = [fix.position_deg[0] - 48.85 - f64::from(number) * 1e-5, fix.position_deg[1] - 2.35];
        assert!(off.iter().all(|off| off.abs() < 1e-8), "{fix:?}");
        assert!((fix.altitude_m.expect("has one") - 104.5).abs() < 1e-3 && fix.quality == 4, "{fix:?}");
        assert_eq!(fix.stamp.0, BEGIN + i64::from(number) * 50_000_000);
    }
    assert!((gnss.origin[0] - fixes[0].position_deg[0]).abs() < 1e-9 && (gnss.origin[2] - 104.5).abs() < 1e-3);
}

#[test]
fn clouds_of_all_drivers_give_the_same_sweeps() {
    for (name, off_nanos, has_rings, missing, words) in [
        ("ouster", Some(0), true, &[(15, 0)][..], "point times: field t, ns from the stamp"),
        // f64 seconds since 1970.
        ("hesai", Some(240), true, &[(3, 1)], "point times: field timestamp, s since 1970"),
        // f64 ns since 1970.
        ("livox_cloud", Some(256), false, &[], "point times: field timestamp, ns since 1970"),
        ("livox_custom", Some(0), false, &[], "point times: field offset_time, ns from the stamp"),
        ("untimed", None, false, &[], "no point times: the clouds have no such field; sweeps begin at the stamps"),
    ] {
        let folder = folder();
        let (_, report, drive) = imported(name, &folder);
        assert!(report.iter().any(|line| line == words), "{name}: {report:?}");
        assert!(report.iter().any(|line| line.contains("the body frame is the LiDAR frame")), "{name}: {report:?}");
        assert_eq!(drive.model().name(), if has_rings { "vlp16" } else { "mid360" }, "{name}");
        check_sweeps(&drive, off_nanos, has_rings, name != "untimed", missing);
    }
}

#[test]
fn parts_of_a_split_recording_are_named_one_by_one() {
    let folder = folder();
    let mut import = import_from(bag("street_split/a.bag"), &folder);
    import.run().expect("imports the end alone");
    assert_eq!(Drive::open(&import.out).expect("opens").sweep_files().len(), 2);
    import.out = folder.path().join("street_split.drive");
    import.options.ros.parts = vec![bag("street_split/b.bag")];
    import.run().expect("imports both");
    let drive = Drive::open(&import.out).expect("opens");
    check_sweeps(&drive, Some(8), true, true, &[]);
    assert_eq!(drive.imu().expect("opens").expect("has one").count(), 6);
}

#[test]
fn frames_of_tf_that_never_move_are_taken_and_others_are_refused_by_name() {
    let folder = folder();
    let (mut import, report, drive) = imported("moving.bag", &folder);
    let has = |report: &[String], words: &str| assert!(report.iter().any(|line| line.contains(words)), "{report:?}");
    has(&report, "frames of tf that never move are taken: camera_optical, turret_optical, velodyne");
    has(&report, "the body frame is \"base_link\"");
    has(&report, "images of /gray/image_raw have 16 bits; they become 8 bits: 65535 becomes 255");
    has(
        &report,
        "of /turret/image_raw (sensor_msgs/Image): frame \"turret\" moves in \"base_link\" on tf, by 0 mm and 57.3 degrees",
    );
    assert!((drive.rig().body_from_lidar.translation.vector - Vector3::new(0.5, 0.0, 1.9)).norm() < 1e-12);
    assert_eq!(drive.rig().cameras.len(), 1);
    for frame in drive.camera_frames() {
        let image = image::open(&frame.path).expect("is an image").to_luma8();
        assert_eq!(image.dimensions(), (8, 6));
        assert!(image.pixels().all(|pixel| pixel.0 == [100]), "{:?}", frame.path);
    }
    // A given pose replaces the moving one; the images are coded by ITU-R BT.601.
    import.out = folder.path().join("given");
    import.options.ros.transforms = vec![("turret_optical".into(), [0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0])];
    import.run().expect("imports");
    let drive = Drive::open(&import.out).expect("opens");
    assert_eq!(drive.rig().cameras.len(), 2);
    let frame = drive.camera_frames().iter().find(|frame| frame.camera == 1).expect("has one");
    let image = image::open(&frame.path).expect("is an image").to_rgb8();
    assert_eq!(image.dimensions(), (8, 6));
    assert!(image.pixels().all(|pixel| pixel.0[2] < 5 || pixel.0[1] > 0), "{image:?}");
    // The LiDAR must also be fixed.
    import.out = folder.path().join("odom");
    import.options.ros.body_frame = Some("odom".into());
    let error = import.run().expect_err("is refused").to_string();
    assert!(
        error.contains(
            "frame \"base_link\" moves in \"odom\" on tf, by 2000 mm and 11.5 degrees: a sensor must be fixed"
        ),
        "{error}"
    );
}

#[test]
fn rings_counted_from_the_highest_are_reported() {
    let folder = folder();
    let (_, report, _) = imported("ouster", &folder);
    assert!(report.iter().any(|line| line == "rings: field ring, 16 beams counted from the highest"), "{report:?}");
}

#[test]
fn sensors_without_transform_are_left_out_unless_it_is_given_or_they_are_asked_for() {
    let folder = folder();
    let mut import = import_from(bag("cameras.bag"), &folder);
    let report = import.run().expect("imports");
    let left_out: Vec<&String> = report.iter().filter(|line| line.starts_with("not imported")).collect();
    assert_eq!(left_out.len(), 3, "{report:?}");
    assert!(left_out[0].starts_with("not imported: 1 message of /left/image_raw/compressed (sensor_msgs/CompressedImage): no transform from \"velodyne\" to \"camera_optical\""), "{left_out:?}");
    assert!(left_out[2].contains("--transform \"gnss=x,y,z,qx,qy,qz,qw\""), "{left_out:?}");
    assert!(!import.out.join("camera/0").exists() && !import.out.join("gnss.nmea").exists());

    import.out = folder.path().join("asked");
    import.options.ros.topics = vec![("camera.0".into(), "/right/image_raw/compressed".into())];
    let error = import.run().expect_err("is refused").to_string();
    assert!(error.contains("/right/image_raw/compressed: no transform from"), "{error}");

    import.options.ros.topics.push(("nmea".into(), "none".into()));
    let upright = [0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0];
    import.options.ros.transforms = vec![("camera_optical".into(), upright), ("velodyne".into(), upright)];
    let report = import.run().expect("imports");
    assert!(
        report.iter().any(|line| line == "not imported: 2 messages of /nmea_sentence (nmea_msgs/Sentence)"),
        "{report:?}"
    );
    let drive = Drive::open(&import.out).expect("opens");
    assert_eq!((drive.camera_frames().len(), drive.manifest().cameras[0].name.as_str()), (1, "right"));
    assert_eq!(drive.rig().body_from_lidar.translation.z, 2.0);
    let image = image::open(&drive.camera_frames()[0].path).expect("is an image").to_luma8();
    assert_eq!(image.as_raw()[..], [1, 2, 3, 4, 5, 6, 7, 8]);

    import.out = folder.path().join("gnss");
    import.options.ros.topics = vec![("camera".into(), "none".into())];
    import.options.ros.transforms.push(("gnss".into(), upright));
    import.run().expect("imports");
    let drive = Drive::open(&import.out).expect("opens");
    assert_eq!(drive.manifest().gnss.as_ref().expect("has one").origin, [48.85, 2.35, 104.5]);
    let (fixes, _) = drive.fixes().expect("reads");
    assert!((fixes[0].speed_mps.expect("has one") - 1.5433).abs() < 1e-3, "{fixes:?}");
}

#[test]
fn options_that_do_not_fit_are_refused_by_name() {
    let folder = folder();
    let mut import = import_from(bag("street.bag"), &folder);
    for (role, name, words) in [
        ("lidar", "/imu/data", "--topic: lidar=/imu/data: messages of type sensor_msgs/Imu cannot have this role"),
        (
            "lidar",
            "/nothing",
            "the bag has no such topic; it has /cam/camera_info (sensor_msgs/CameraInfo), /cam/image_raw",
        ),
        ("radar", "/x", "role \"radar\" must be lidar, camera.0"),
        ("camera.1", "/cam/image_raw", "camera.0 is missing"),
    ] {
        import.options.ros.topics = vec![(role.into(), name.into())];
        let error = import.run().expect_err(words).to_string();
        assert!(error.contains(words), "{error}");
    }
    import.options.ros.topics.clear();
    import.options.ros.body_frame = Some("odom".into());
    let error = import.run().expect_err("is refused").to_string();
    assert!(error.contains("no transform from \"odom\" to \"velodyne\" in tf_static"), "{error}");
    assert_eq!(folder.path().read_dir().expect("lists").count(), 0, "nothing is written");
}

#[test]
fn further_lidar_in_a_frame_of_its_own_is_named_with_the_option_that_takes_it() {
    let folder = folder();
    let mut import = import_from(bag("two_lidars.bag"), &folder);
    let choice = |role: &str, name: &str| (role.to_owned(), name.to_owned());
    import.options.ros.topics = vec![choice("lidar", "/front/points")];
    let report = import.run().expect("imports");
    let cloud = "(sensor_msgs/PointCloud2)";
    // The filtered clouds are in the frame of the imported LiDAR.
    for line in [
        format!("not imported: 3 messages of /front/filtered {cloud}"),
        format!(
            "not imported: 3 messages of /rear/points {cloud}: a further LiDAR in frame \"rear\"; --topic lidar.1=/rear/points takes it"
        ),
    ] {
        assert!(report.contains(&line), "{line}: {report:?}");
    }
    std::fs::remove_dir_all(&import.out).expect("removes");
    import.options.ros.topics.push(choice("lidar.1", "/rear/points"));
    let report = import.run().expect("imports");
    assert_eq!(report.iter().filter(|line| line.starts_with("not imported")).count(), 1, "{report:?}");
    let drive = Drive::open(&import.out).expect("opens");
    let rear = drive.rig().body_from_other_lidars[0];
    assert!((rear.translation.vector - Vector3::new(-1.4, 0.0, 1.3)).norm() < 1e-9, "{rear:?}");
}

#[test]
fn second_lidar_of_bag_is_one_of_the_drive() {
    let folder = folder();
    let mut import = import_from(bag("street_mcap"), &folder);
    let topic = |role: &str| (role.to_owned(), "/velodyne_points".to_owned());
    import.options.ros.topics = vec![topic("lidar"), topic("lidar.1")];
    let report = import.run().expect("imports");
    assert_eq!(report.iter().filter(|line| line.contains("/velodyne_points")).count() % 2, 0, "{report:?}");
    let drive = Drive::open(&import.out).expect("opens");
    let lidars: Vec<_> = drive.lidars().collect();
    assert_eq!((lidars.len(), lidars[0].files.len(), lidars[1].files.len()), (2, 3, 3));
    assert_eq!(drive.manifest().lidar_name(1), "velodyne_points_1");
    assert_eq!(lidars[0].stamps, lidars[1].stamps);
    assert_eq!(drive.rig().body_from_other_lidars, [drive.rig().body_from_lidar]);
    let mut gap = import_from(bag("street_mcap"), &folder);
    gap.out = folder.path().join("gap");
    gap.options.ros.topics = vec![topic("lidar"), topic("lidar.2")];
    let error = gap.run().expect_err("has no lidar.1").to_string();
    assert!(error.contains("lidar.1 is missing"), "{error}");
}
