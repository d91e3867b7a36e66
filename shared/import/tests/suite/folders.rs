//! Imports of small folders in the layouts of the data sets, and of real sweeps.

use super::support::{error, folder, import_from, write_file};
use drive::Drive;
use formats::cloud::CloudPoint;
use formats::{kitti, nuscenes};
use import::Kind;

fn points(intensity: f32) -> Vec<CloudPoint> {
    (1..=40).map(|i| CloudPoint { x: i as f32, y: 1.0, z: -1.0, intensity }).collect()
}

fn rows_with_ring() -> Vec<u8> {
    let rows: Vec<(CloudPoint, u8)> = points(17.0).into_iter().map(|point| (point, 31)).collect();
    nuscenes::bin_from_points(&rows)
}

#[test]
fn folders_of_recordings_without_their_metadata_name_the_next_step() {
    for (names, words) in [
        (vec!["a.mcap"], ["1 *.mcap", "a.mcap, or write metadata.yaml with `ros2 bag reindex`"]),
        (vec!["a_0.db3"], ["1 *.db3", "a_0.db3, or write metadata.yaml"]),
        (vec!["a_0.mcap", "a_1.mcap"], ["2 *.mcap", "whether they are parts of one recording"]),
        (vec!["a.bag"], ["1 *.bag", "is not a bag of ROS 1"]),
        (vec!["a.pcap", "b.pcap"], ["2 *.pcap", "captures need no import; set run.drive = "]),
    ] {
        let folder = folder();
        let source = folder.path().join("recording");
        for name in names {
            write_file(&source.join(name), "?");
        }
        let error = error(&import_from(&source, &folder));
        assert!(words.iter().all(|word| error.contains(word)) && !error.contains("no known layout"), "{error}");
    }
}

#[test]
fn kitti_raw_folder_becomes_drive_of_links_and_lists_what_is_left_out() {
    let folder = folder();
    let raw = folder.path().join("day/raw");
    for k in 0..3 {
        write_file(
            &raw.join(format!("velodyne_points/data/{k:010}.bin")),
            [5.0_f32, 0.0, 0.0, 0.5].map(f32::to_le_bytes).concat(),
        );
        write_file(&raw.join(format!("image_02/data/{k:010}.png")), "");
    }
    let dates = "2011-09-26 13:02:25.9\n2011-09-26 13:02:26.0\n2011-09-26 13:02:26.125\n";
    write_file(&raw.join("velodyne_points/timestamps.txt"), dates);
    write_file(&raw.join("velodyne_points/timestamps_start.txt"), dates);
    write_file(&raw.join("image_02/timestamps.txt"), dates);
    write_file(&raw.join("oxts/data/0000000000.txt"), "1 2 3\n");
    write_file(&folder.path().join("day/calib_velo_to_cam.txt"), "R: 1\n");
    let mut import = import_from(&raw, &folder);
    import.options.lidar_only = true;
    let report = import.run().expect("imports");
    assert!(report[0].ends_with("drive: 3 sweeps of hdl64e (KITTI raw)"), "{report:?}");
    assert_eq!(
        report[1..],
        [
            "imported: 3 sweeps and their times",
            "not imported: 1 file in image_02 (camera images)",
            "not imported: 3 files in image_02/data (camera images)",
            "not imported: 1 file in oxts/data (GNSS and IMU)",
            "not imported: 1 file in velodyne_points (other LiDAR files)",
            "not imported: ../calib_velo_to_cam.txt (calibration)",
        ]
    );
    let drive = Drive::open(&import.out).expect("opens");
    assert!(!drive.is_inferred());
    assert!(drive.sweep_files().iter().all(|path| path.is_symlink()));
    let mut sweeps = drive.sweeps().expect("opens");
    let mut stamps = Vec::new();
    while let Some(sweep) = sweeps.next_sweep(|_| {}).expect("reads") {
        stamps.push(sweep.stamp.0 - 1_317_042_145_000_000_000);
    }
    assert_eq!(stamps, [900_000_000, 1_000_000_000, 1_125_000_000]);
    assert!(import.run().is_err(), "an existing drive is not overwritten");
}

#[test]
fn nuscenes_folder_is_imported_in_the_order_of_times_with_its_rings() {
    let folder = folder();
    let root = folder.path().join("nuscenes");
    for (kind, micros) in [("sweeps", 1_000_050_000_i64), ("samples", 1_000_100_000), ("sweeps", 1_000_150_000)] {
        let name = format!("{kind}/LIDAR_TOP/n015__LIDAR_TOP__{micros}.pcd.bin");
        write_file(&root.join(name), rows_with_ring());
    }
    write_file(&root.join("samples/CAM_FRONT/n015__CAM_FRONT__1000100000.jpg"), "");
    let import = import_from(&root, &folder);
    let report = import.run().expect("imports");
    assert!(report[0].ends_with("3 sweeps of hdl32e (nuScenes)"), "{report:?}");
    assert!(report.contains(&"not imported: 1 file in samples/CAM_FRONT (camera images)".to_owned()), "{report:?}");
    let drive = Drive::open(&import.out).expect("opens");
    let mut sweeps = drive.sweeps().expect("opens");
    let mut stamps = Vec::new();
    let mut rings = Vec::new();
    while let Some(sweep) = sweeps.next_sweep(|returns| rings.extend(returns.iter().map(|r| r.ring))).expect("reads") {
        stamps.push(sweep.stamp.0);
    }
    // The times in the names, to which the points are motion-compensated.
    assert_eq!(stamps, [1_000_050_000_000, 1_000_100_000_000, 1_000_150_000_000]);
    assert!(rings.len() == 3 * 40 && rings.iter().all(|ring| *ring == 31));
    // The LiDAR's y axis points forward.
    let forward = drive.rig().body_from_lidar.rotation * geometry::Vector3::y();
    assert!((forward[0] - 1.0).abs() < 1e-12, "{forward:?}");
}

#[test]
fn sweeps_of_several_logs_need_a_choice() {
    let folder = folder();
    let root = folder.path().join("nuscenes");
    for log in ["n008-a", "n015-b"] {
        write_file(&root.join(format!("{log}__LIDAR_TOP__1000050000.pcd.bin")), rows_with_ring());
    }
    let mut import = import_from(&root, &folder);
    assert!(error(&import).contains("2 logs; choose one with --log: n008-a, n015-b"), "{}", error(&import));
    import.options.log = Some("n015-b".into());
    import.run().expect("imports");
    assert_eq!(Drive::open(&import.out).expect("opens").sweep_files().len(), 1);
}

#[test]
fn rows_of_another_layout_are_refused() {
    let folder = folder();
    for (name, bytes, words) in [
        ("ring", rows_with_ring(), "point 0: intensity 17 must be 0 to 1"),
        ("size", vec![0; 33], "33 bytes must be rows of 16 bytes"),
        ("empty", Vec::new(), "0 bytes must be rows of 16 bytes"),
        ("noise", (0..=255).collect(), "must be 0 to"),
    ] {
        let source = folder.path().join(name);
        write_file(&source.join("0.bin"), bytes);
        let error = error(&import_from(&source, &folder));
        assert!(error.contains(words) && error.contains("0.bin"), "{name}: {error}");
        assert_eq!(error.contains("--kind nuscenes"), name == "ring", "{error}");
    }
    assert!(error(&import_from(folder.path(), &folder)).contains("no known layout"));
}

#[test]
fn kind_and_model_of_the_command_line_are_used() {
    let folder = folder();
    let source = folder.path().join("bare");
    write_file(&source.join("0.bin"), kitti::bin_from_points(&points(200.0)));
    let mut import = import_from(&source, &folder);
    assert!(error(&import).contains("intensity 200 must be 0 to 1"));
    import.options.kind = Some(Kind::Bin);
    import.options.model = Some(lidar::velodyne::Model::Vlp16.into());
    let report = import.run().expect("imports");
    assert!(report[0].contains("1 sweep of vlp16"), "{report:?}");
    assert!(report[1].contains("no times"), "{report:?}");
}

#[test]
fn bare_sweeps_report_the_assumed_model() {
    let folder = folder();
    let source = folder.path().join("bare");
    write_file(&source.join("0.pcd"), formats::pcd::pcd_from_points(&points(0.5)));
    let report = import_from(&source, &folder).run().expect("imports");
    assert!(report.iter().any(|line| line.contains("hdl64e is assumed")), "{report:?}");
}

#[real_data::test("nuscenes/*.pcd.bin", "kitti00/*.bin", "kitti_raw_0048/*.pcd")]
fn real_folders_are_recognized() {
    for (name, kind, n) in [
        ("nuscenes", "1 sweep of hdl32e (nuScenes)", 1),
        ("kitti00", "2 sweeps of hdl64e (bare sweeps)", 2),
        ("kitti_raw_0048", "22 sweeps of hdl64e (bare sweeps)", 22),
    ] {
        let folder = folder();
        let import = import_from(real_data::path(name), &folder);
        let report = import.run().expect("imports");
        assert!(report[0].contains(kind), "{report:?}");
        assert!(report.iter().any(|line| line.starts_with("not imported")), "{report:?}");
        assert_eq!(Drive::open(&import.out).expect("opens").sweep_files().len(), n);
    }
}
