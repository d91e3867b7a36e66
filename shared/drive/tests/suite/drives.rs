//! Drive folders: contents, and all faults reported at once.

use drive::{Drive, Frame, TIMES_FILE};
use files::problems::FileProblem;
use formats::cloud::{CloudPoint, FiredCloud, FiredPoint};
use formats::nuscenes;
use formats::pcd::pcd_from_cloud;
use lidar::velodyne::Model;
use std::fs;
use std::path::Path;

const GOOD: &str = r#"version = 1
name = "two sensors"

[lidar]
model = "hdl64e"
format = "bin"
folder = "lidar"
body_from_lidar = { translation = [0, 0, 1.9], rotation = [0, 0, 0, 1] }

[[camera]]
name = "front"
folder = "camera/0"
exposure_nanos = 5000000
body_from_camera = { translation = [0, 0, 1], rotation = [0, 0, 0, 1] }
model = { kind = "pinhole", width = 64, height = 48, fx = 60.0, fy = 60.0, cx = 32.0, cy = 24.0 }

[gnss]
file = "gnss.nmea"
origin = [48.8, 2.3, 100.0]
antenna_in_body = [0, 0, 2]
"#;

fn drive(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("has one")).expect("makes");
        fs::write(path, bytes).expect("writes");
    };
    write("drive.toml", text.as_bytes());
    for k in 0..3 {
        write(&format!("lidar/{k:06}.bin"), &[0; 16]);
    }
    for stamp in [300, 100, 200] {
        write(&format!("camera/0/{stamp}.jpg"), b"");
    }
    write("camera/0/thumbs.png", b"");
    write("gnss.nmea", b"");
    folder
}

fn problems(folder: &Path) -> Vec<FileProblem> {
    Drive::open(folder).expect_err("has faults").problems
}

#[test]
fn valid_folder_lists_files_by_stamp() {
    let folder = drive(GOOD);
    let drive = Drive::open(folder.path()).expect("is valid");
    assert_eq!((drive.model(), drive.sweep_files().len(), drive.is_inferred()), (Model::Hdl64e.into(), 3, false));
    let stamps: Vec<i64> = drive.camera_frames().iter().map(|frame| frame.stamp.0).collect();
    assert_eq!(stamps, [100, 200, 300]);
    assert_eq!(drive.strange_files().len(), 1);
    assert!((drive.rig().body_from_lidar.translation.z - 1.9).abs() < 1e-12);
}

#[test]
fn truth_of_a_trajectory_alone_is_accepted() {
    let folder = drive(&format!("{GOOD}\n[truth]\ntrajectory = \"truth.txt\"\n"));
    fs::write(folder.path().join("truth.txt"), "0.0 1 2 3 0 0 0 1\n").expect("writes");
    let drive = Drive::open(folder.path()).expect("opens");
    assert!(drive.true_trajectory().is_some_and(|truth| truth.is_ok()));
    let error = drive.true_labels().expect_err("has no labels");
    assert!(error.to_string().contains("labels"), "{error}");
}

#[test]
fn every_fault_is_reported_with_its_line() {
    let text = GOOD
        .replace("version = 1", "version = 9")
        .replace("hdl64e", "hdl65e")
        .replace("rotation = [0, 0, 0, 1] }\n\n", "rotation = [0, 0, 0, 2] }\n\n")
        .replace("camera/0", "../camera")
        .replace("fx = 60.0", "fx = -1.0")
        .replace("48.8", "98.8")
        .replace("gnss.nmea", "fixes.nmea");
    let folder = drive(&text);
    let found: Vec<(Option<usize>, String)> =
        problems(folder.path()).into_iter().map(|problem| (problem.line, problem.key)).collect();
    let expected = [
        (1, "version"),
        (8, "lidar.body_from_lidar"),
        (5, "lidar.model"),
        (15, "camera[0].model"),
        (12, "camera[0].folder"),
        (19, "gnss.origin"),
        (18, "gnss.file"),
    ];
    assert_eq!(found, expected.map(|(line, key)| (Some(line), key.to_owned())));
}

#[test]
fn unreadable_entries_do_not_hide_other_faults() {
    let text = GOOD.replace("folder = \"lidar\"", "foldr = \"lidar\"").replace("origin = [48.8, 2.3, 100.0]\n", "")
        + "\n[radar]\nfile = \"x\"\n";
    let folder = drive(&text);
    let found = problems(folder.path());
    let texts: Vec<String> = found.iter().map(ToString::to_string).collect();
    for (problem, (key, words)) in found.iter().zip([
        ("radar", "unknown key"),
        ("lidar", "missing field `folder`"),
        ("lidar", "foldr"),
        ("gnss", "missing field `origin`"),
    ]) {
        assert!(problem.key == key && problem.rule.contains(words) && problem.line.is_some(), "{texts:?}");
    }
    assert_eq!(found.len(), 4, "{texts:?}");
    fs::write(folder.path().join("drive.toml"), "version = [").expect("writes");
    assert_eq!(problems(folder.path())[0].line, Some(1));
    fs::remove_file(folder.path().join("drive.toml")).expect("removes");
    assert!(problems(folder.path())[0].rule.contains("neither drive.toml nor *.pcd"));
    assert!(problems(&folder.path().join("nowhere"))[0].rule.contains("not a folder"));
}

/// Regression: each start reported only the first of several faults.
#[test]
fn faults_of_all_kinds_are_reported_at_once() {
    let text = GOOD
        .replace("version = 1", "version = 2")
        .replace("model = \"hdl64e\"", "model = 64")
        .replace("format = \"bin\"", "format = \"las\"")
        .replace("folder = \"lidar\"", "folder = [\"lidar\"]")
        .replace("exposure_nanos = 5000000", "exposure_nanos = \"5 ms\"")
        .replace("48.8", "98.8")
        .replace("gnss.nmea", "fixes.nmea")
        .replace("name = \"front\"\n", "");
    let folder = drive(&text);
    let found = problems(folder.path());
    let texts: Vec<String> = found.iter().map(ToString::to_string).collect();
    for (line, words) in [
        (5, "lidar: invalid type: integer `64`"),
        (7, "lidar: invalid type: sequence"),
        (10, "camera[0]: missing field `name`"),
        (12, "camera[0]: invalid type: string \"5 ms\""),
        (1, "version: value 2"),
        (18, "gnss.origin: value"),
        (17, "gnss.file: "),
    ] {
        let is_found =
            found.iter().zip(&texts).any(|(problem, text)| problem.line == Some(line) && text.contains(words));
        assert!(is_found, "{line}: {words:?} is not in {texts:#?}");
    }
    assert_eq!(found.len(), 7, "{texts:#?}");
}

#[test]
fn all_missing_fields_are_reported() {
    // Two texts, because the first 20 problems are reported.
    for (text, expected) in [
        ("[lidar]\n[[camera]]\n[truth]\n", [1, 1, 4, 5, 0, 0, 0, 1]),
        ("[[mosaic]]\n[gnss]\n[imu]\n", [1, 1, 1, 0, 12, 3, 1, 0]),
    ] {
        let folder = drive(text);
        let found = problems(folder.path());
        let n_missing = |key: &str| found.iter().filter(|problem| problem.key == key).count();
        let keys = ["version", "name", "lidar", "camera[0]", "mosaic[0]", "gnss", "imu", "truth"];
        assert_eq!(keys.map(n_missing), expected, "{found:#?}");
    }
}

#[test]
fn images_larger_than_a_message_are_refused() {
    let folder = drive(&GOOD.replace("width = 64, height = 48", "width = 8000, height = 6000"));
    let found = problems(folder.path());
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(
        found[0].to_string().contains("camera[0].model: 8000 x 6000 pixels of 3 colors: 144000000 values"),
        "{found:#?}"
    );
}

#[test]
fn times_file_must_match_the_clouds() {
    let folder = drive(GOOD);
    let times = folder.path().join("lidar").join(TIMES_FILE);
    for (text, is_good) in [("5\n70\n90\n", true), ("5\n70\n", false), ("5\n90\n70\n", false), ("5\nx\n70\n", false)] {
        fs::write(&times, text).expect("writes");
        assert_eq!(Drive::open(folder.path()).is_ok(), is_good, "{text:?}");
    }
}

#[test]
fn cloud_files_with_times_are_sweeps_with_times() {
    let folder = drive(&GOOD.replace("\"bin\"", "\"pcd\""));
    let point = CloudPoint { x: 5.0, intensity: 9.0, ..CloudPoint::default() };
    let cloud = |last_nanos: u32| {
        let fired = |(ring, offset_nanos)| FiredPoint { point, ring, offset_nanos };
        let points = [(3, last_nanos), (63, 0), (1, 500)].map(fired).to_vec();
        pcd_from_cloud(&FiredCloud { points, has_rings: true, has_times: true })
    };
    // The second ends 11 % after the third begins, the last has the duration of the previous one.
    let lasts = [109_000_000, 111_000_000, 99_000_000, 40_000_000];
    for (number, last) in lasts.into_iter().enumerate() {
        fs::write(folder.path().join(format!("lidar/{number}.pcd")), cloud(last)).expect("writes");
    }
    fs::write(folder.path().join("lidar").join(TIMES_FILE), "5\n100000005\n200000005\n300000005\n").expect("writes");
    let drive = Drive::open(folder.path()).expect("opens");
    let mut sweeps = drive.sweeps().expect("opens");
    let mut found = Vec::new();
    let mut returns = Vec::new();
    while let Some(sweep) = sweeps.next_sweep(|piece| returns.extend_from_slice(piece)).expect("reads") {
        assert!(sweep.has_times);
        let order: Vec<u8> = returns.drain(..).map(|found| found.ring).collect();
        assert_eq!(order, [63, 1, 3]);
        found.push((sweep.stamp.0, sweep.duration_nanos));
    }
    assert_eq!(found, [(5, 109_000_000), (200_000_005, 100_000_000), (300_000_005, 100_000_000)]);
    let damage = sweeps.damage();
    let words = "1.pcd: points reach 111000000 ns after the sweep's stamp, the next sweep begins after 100000000 ns";
    assert!(damage.len() == 1 && damage[0].contains(words), "{damage:?}");
}

fn write_clouds(folder: &Path, names: &[&str]) {
    for (k, name) in (1..).zip(names) {
        let point = CloudPoint { x: k as f32, y: 0.0, z: 0.0, intensity: 0.5 };
        fs::write(folder.join(name), formats::kitti::bin_from_points(&[point])).expect("writes");
    }
}

/// Stamps in ms and distances of the sweeps of a folder.
fn sweeps_of(folder: &Path) -> Vec<(i64, f32)> {
    let drive = Drive::open(folder).expect("opens");
    let mut sweeps = drive.sweeps().expect("opens");
    let mut found = Vec::new();
    let mut x_m = 0.0;
    while let Some(sweep) = sweeps.next_sweep(|piece| x_m = piece[0].x).expect("reads") {
        found.push((sweep.stamp.0 / 1_000_000, x_m));
    }
    found
}

#[test]
fn sweeps_are_in_natural_order_of_their_names_and_missing_numbers_leave_their_time() {
    for form in ["", "full", "frame_"] {
        let folder = tempfile::tempdir().expect("a folder");
        let names: Vec<String> = [0, 1, 2, 9, 10, 11].iter().map(|number| format!("{form}{number}.bin")).collect();
        write_clouds(folder.path(), &names.iter().map(String::as_str).collect::<Vec<_>>());
        let expected = [(0, 1.0), (100, 2.0), (200, 3.0), (900, 4.0), (1000, 5.0), (1100, 6.0)];
        assert_eq!(sweeps_of(folder.path()), expected);
        let drive = Drive::open(folder.path()).expect("opens");
        let missing = &drive.lidars().next().expect("has one").missing;
        assert_eq!(missing.n_files, 6);
        assert!(
            missing.texts[0].contains(&format!("6 between {} (16 bytes) and {}", names[2], names[3])),
            "{missing:?}"
        );
        // Stamps state the times.
        let stamps = "5000000\n105000000\n205000000\n305000000\n405000000\n505000000\n";
        fs::write(folder.path().join(TIMES_FILE), stamps).expect("writes");
        assert_eq!(sweeps_of(folder.path())[3..], [(305, 4.0), (405, 5.0), (505, 6.0)]);
        assert_eq!(Drive::open(folder.path()).expect("opens").lidars().next().expect("has one").missing.n_files, 0);
    }
}

#[test]
fn folder_with_several_kinds_of_recordings_is_refused_with_their_names() {
    for (other, words) in
        [("a.bag", "1 *.bag (first: a.bag; 3 bytes)"), ("a.pcap1", "1 *.pcap (first: a.pcap1; 3 bytes)")]
    {
        let folder = tempfile::tempdir().expect("a folder");
        write_clouds(folder.path(), &["0.bin", "1.bin"]);
        fs::write(folder.path().join(other), "bag").expect("writes");
        let found = problems(folder.path());
        let rule = found[0].to_string();
        assert!(
            found.len() == 1 && rule.contains("2 *.bin (first: 0.bin; 32 bytes)") && rule.contains(words),
            "{rule}"
        );
    }
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("dump-1700000000"), [0xd4, 0xc3, 0xb2, 0xa1, 0, 0]).expect("writes");
    let rule = problems(folder.path())[0].to_string();
    assert!(
        rule.contains("captures by their first bytes") && rule.contains("dump-1700000000; name them *.pcap"),
        "{rule}"
    );
}

#[real_data::test("kitti_raw_0048/*.pcd")]
fn folder_of_real_sweeps_without_manifest_opens_as_drive() {
    let folder = real_data::path("kitti_raw_0048");
    let drive = Drive::open(&folder).expect("opens");
    assert!(drive.is_inferred());
    assert_eq!((drive.model(), drive.sweep_files().len()), (Model::Hdl64e.into(), 22));
    let mut sweeps = drive.sweeps().expect("opens");
    let mut returns = Vec::new();
    let mut positions = Vec::new();
    let mut found = Vec::new();
    while let Some(sweep) = sweeps.next_sweep(|piece| returns.extend_from_slice(piece)).expect("reads") {
        positions.push(sweeps.position());
        found.push(sweep);
    }
    assert_eq!(found.len(), 22);
    assert!(found.iter().enumerate().all(|(k, sweep)| sweep.stamp.0 == k as i64 * 100_000_000 && !sweep.has_times));
    let mut by_ring = [0; 64];
    for one in &returns {
        by_ring[usize::from(one.ring)] += 1;
    }
    // Every beam sees its part of the street; the lowest ones see the car's roof.
    assert!(by_ring.iter().all(|n| (20_000..50_000).contains(n)), "{by_ring:?}");
    // The data set keeps what is nearer than 80 m; the roof of the car is nearest.
    let mut distances_m: Vec<f32> = returns.iter().map(|one| one.x.hypot(one.y)).collect();
    distances_m.sort_by(f32::total_cmp);
    let [nearest, middle, farthest] = [0, distances_m.len() / 2, distances_m.len() - 1].map(|at| distances_m[at]);
    assert_eq!(distances_m.len(), 2_603_914);
    assert!((1.3..1.5).contains(&nearest) && (79.9..80.0).contains(&farthest), "{nearest} {farthest}");
    assert!((8.4..8.45).contains(&middle), "{middle}");
    // Reads the last third again from a saved position.
    let mut again = drive.sweeps().expect("opens");
    assert!(again.resume(positions[14].clone()).expect("is there"));
    assert_eq!(again.next_sweep(|_| {}).expect("reads"), Some(found[15]));
}

#[real_data::test("velodyne/vlp16_moving_car.pcap")]
fn folder_of_captures_without_manifest_detects_its_sensor() {
    let capture = real_data::path("velodyne/vlp16_moving_car.pcap");
    let folder = tempfile::tempdir().expect("a folder");
    std::os::unix::fs::symlink(capture, folder.path().join("a.pcap")).expect("links");
    let drive = Drive::open(folder.path()).expect("opens");
    assert_eq!((drive.model(), drive.manifest().lidar.format.as_str()), (Model::Vlp16.into(), "pcap"));
}

#[test]
fn sweeps_of_another_layout_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows: Vec<(CloudPoint, u8)> =
        (0..20).map(|ring| (CloudPoint { x: 5.0, intensity: 17.0, ..CloudPoint::default() }, ring)).collect();
    for (name, bytes, words) in [
        ("a__LIDAR_TOP__1.pcd.bin", nuscenes::bin_from_points(&rows), "is a sweep of nuScenes"),
        ("0.bin", nuscenes::bin_from_points(&rows), "point 0: intensity 17 must be 0 to 1"),
        ("0.bin", vec![0; 30], "30 bytes are not a multiple of the row size"),
    ] {
        let sweeps = folder.path().join(name.len().to_string());
        fs::create_dir_all(&sweeps).expect("makes");
        fs::write(sweeps.join(name), bytes).expect("writes");
        let found = problems(&sweeps);
        assert!(found[0].rule.contains(words) && found[0].rule.contains("replica import"), "{found:?}");
    }
    let folder = drive(GOOD);
    fs::rename(folder.path().join("lidar/000001.bin"), folder.path().join("lidar/000001.pcd.bin")).expect("renames");
    let found = problems(folder.path());
    assert!(found.len() == 1 && found[0].key == "lidar.format" && found[0].rule.contains("nuscenes"), "{found:?}");
}

#[test]
fn nuscenes_sweeps_keep_the_rings_of_the_file() {
    let folder = drive(&GOOD.replace("\"bin\"", "\"nuscenes\"").replace("hdl64e", "hdl32e"));
    for (file, ring) in [(0, 31), (1, 3), (2, 0)] {
        let point = CloudPoint { x: 5.0, intensity: 17.0, ..CloudPoint::default() };
        let bytes = nuscenes::bin_from_points(&[(point, ring), (CloudPoint::default(), ring)]);
        fs::write(folder.path().join(format!("lidar/{file:06}.bin")), bytes).expect("writes");
    }
    let mut sweeps = Drive::open(folder.path()).expect("is valid").sweeps().expect("opens");
    let mut found = Vec::new();
    while sweeps
        .next_sweep(|returns| found.extend(returns.iter().map(|r| (r.ring, r.intensity))))
        .expect("reads")
        .is_some()
    {}
    assert_eq!(found, [(31, 17), (3, 17), (0, 17)], "the returns without range are removed");
}

#[test]
fn mounting_of_inertial_unit_rotates_its_samples_and_excludes_a_second_position() {
    let imu = "\n[imu]\nfile = \"imu.csv\"\nbody_from_imu = { translation = [0, 0, 0.5], rotation = [1, 0, 0, 0] }\n";
    let folder = drive(&format!("{GOOD}{imu}"));
    let samples = format!("{}\n1,1,2,-9.81,0.1,0.2,0.3\n", drive::imu::HEADER);
    fs::write(folder.path().join("imu.csv"), samples).expect("writes");
    let opened = Drive::open(folder.path()).expect("sound");
    let mounting = opened.manifest().imu.as_ref().expect("a unit").mounting();
    assert_eq!(mounting.translation.vector.z, 0.5);
    let sample = opened.imu().expect("opens").expect("a unit").next().expect("a sample").expect("reads");
    assert!(
        (sample.acceleration[2] - 9.81).abs() < 1e-12 && (sample.angular_rate[1] + 0.2).abs() < 1e-12,
        "{sample:?}"
    );
    let twice = imu.replace("file", "position_in_body = [0, 0, 1]\nfile").replace("[1, 0, 0, 0]", "[1, 1, 0, 0]");
    fs::write(folder.path().join("drive.toml"), format!("{GOOD}{twice}")).expect("writes");
    let texts: Vec<String> = problems(folder.path()).iter().map(ToString::to_string).collect();
    assert!(texts.len() == 2 && texts.iter().all(|text| text.contains("imu.body_from_imu")), "{texts:?}");
}

#[test]
fn delay_of_a_mosaic_camera_is_subtracted_from_its_stamps_only() {
    let opened = |delay: &str| {
        let mosaic = format!(
            "[[mosaic]]
name = \"hs03\"
folder = \"hs03\"
exposure_nanos = 5000000
{delay}
dark_exposure_nanos = 5000000
white_exposure_nanos = 5000000
white_reflectance = 0.98
bit_depth = 10
pattern = 2
active_area = [0, 0, 8, 4]
wavelengths_nm = [470.0, 480.0, 490.0, 500.0]
body_from_camera = {{ translation = [0, 0, 1], rotation = [0, 0, 0, 1] }}
model = {{ kind = \"pinhole\", width = 8, height = 4, fx = 60.0, fy = 60.0, cx = 4.0, cy = 2.0 }}
"
        );
        let folder = drive(&format!("{GOOD}\n{mosaic}"));
        fs::create_dir(folder.path().join("hs03")).expect("makes");
        for stamp in [2000, 1000] {
            fs::write(folder.path().join(format!("hs03/{stamp}.pgm")), b"").expect("writes");
        }
        folder
    };
    let stamps = |delay: &str| {
        let folder = opened(delay);
        let drive = Drive::open(folder.path()).expect("is valid");
        let of = |frames: &[Frame]| frames.iter().map(|frame| frame.stamp.0).collect::<Vec<i64>>();
        (of(drive.mosaic_frames()), of(drive.camera_frames()))
    };
    assert_eq!(stamps(""), (vec![1000, 2000], vec![100, 200, 300]));
    assert_eq!(stamps("delay_nanos = 70"), (vec![930, 1930], vec![100, 200, 300]));
    assert_eq!(stamps("delay_nanos = -70"), (vec![1070, 2070], vec![100, 200, 300]));
    let found = problems(opened("delay_nanos = 10_000_000_001").path());
    assert_eq!(found.len(), 1, "{found:?}");
    let text = found[0].to_string();
    assert!(text.contains("mosaic[0].delay_nanos") && text.contains("must be -10 s to 10 s"), "{text}");
}

#[test]
fn delays_are_subtracted_from_all_stamps_of_their_sensor() {
    let samples = "stamp,ax,ay,az,wx,wy,wz\n1000,0,0,9.81,0,0,0\n2000,0,0,9.81,0,0,0\n";
    let nmea = "$GPRMC,120000.000,A,4851.0,N,00221.0,E,3.0,90.0,141123,,,A*5A\n$GPGGA,120000.000,4851.0,N,00221.0,E,4,12,0.9,60.0,M,44.5,M,,*6A\n";
    let opened = |delays: [&str; 3]| {
        let [camera, gnss, imu] = delays;
        let text = GOOD
            .replace("exposure_nanos = 5000000", &format!("exposure_nanos = 5000000\n{camera}"))
            .replace("antenna_in_body = [0, 0, 2]", &format!("antenna_in_body = [0, 0, 2]\n{gnss}"));
        let folder = drive(&format!("{text}\n[imu]\nfile = \"imu.csv\"\n{imu}\n"));
        fs::write(folder.path().join("imu.csv"), samples).expect("writes");
        fs::write(folder.path().join("gnss.nmea"), nmea).expect("writes");
        folder
    };
    let stamps = |folder: &tempfile::TempDir| {
        let drive = Drive::open(folder.path()).expect("is valid");
        let frames: Vec<i64> = drive.camera_frames().iter().map(|frame| frame.stamp.0).collect();
        let imu = drive.imu().expect("opens").expect("has one");
        let samples: Vec<i64> = imu.map(|sample| sample.expect("is valid").stamp.0).collect();
        let fixes: Vec<i64> = drive.fixes().expect("reads").0.iter().map(|fix| fix.stamp.0).collect();
        (frames, samples, fixes)
    };
    let (frames, samples, fixes) = stamps(&opened([""; 3]));
    assert_eq!((frames.as_slice(), samples.as_slice(), fixes.len()), (&[100, 200, 300][..], &[1000, 2000][..], 1));
    // Late images and samples; fixes that are ahead.
    let found = stamps(&opened(["delay_nanos = 50", "delay_nanos = -7000000000", "delay_nanos = 900"]));
    assert_eq!(found, (vec![50, 150, 250], vec![100, 1100], vec![fixes[0] + 7_000_000_000]));

    let folder = opened(["delay_nanos = 10_000_000_001", "delay_nanos = 1.5", "delay_nanos = -20_000_000_000"]);
    let found: Vec<String> = problems(folder.path()).iter().map(ToString::to_string).collect();
    for words in ["camera[0].delay_nanos", "gnss", "imu.delay_nanos", "must be -10 s to 10 s"] {
        assert!(found.iter().any(|problem| problem.contains(words)), "{words:?} is not in {found:?}");
    }

    // A manifest without delays is written without them.
    let folder = opened([""; 3]);
    let manifest = Drive::open(folder.path()).expect("is valid").manifest().clone();
    assert!(!toml::to_string(&manifest).expect("encodes").contains("delay_nanos"));
}
