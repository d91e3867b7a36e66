//! Simulation, conversion, inspection and import.

use crate::support::{printed, replica, succeeded, text};
use std::process::Command;

#[test]
fn simulated_capture_is_converted_and_inspected() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = folder.path().join("drive");
    let clouds = folder.path().join("clouds");
    succeeded(&replica(&["simulate", "--seed", "3", "--seconds", "0.3", "--out", text(&drive)]));
    assert!(drive.join("drive.toml").is_file());
    let again = replica(&["simulate", "--seconds", "0.3", "--out", text(&drive)]);
    assert_eq!(again.status.code(), Some(1), "an existing drive is not overwritten");

    let captures = std::fs::read_dir(drive.join("lidar")).expect("a folder");
    let capture = captures.flatten().next().expect("a capture").path();
    let table = succeeded(&replica(&["convert", text(&capture), text(&clouds)]));
    assert!(table.contains("revolution"), "{table}");
    let n_clouds = std::fs::read_dir(&clouds).expect("a folder").count();
    assert!(n_clouds >= 3, "0.3 s have at least three revolutions, not {n_clouds}");

    // `replica convert … | head -1` cuts the table off, not the clouds.
    let again = folder.path().join("again");
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let mut convert = Command::new(env!("CARGO_BIN_EXE_replica"));
    let status = convert.args(["convert", text(&capture), text(&again)]).stdout(writer).status().expect("starts");
    assert!(status.success(), "{status}");
    assert_eq!(std::fs::read_dir(&again).expect("a folder").count(), n_clouds);

    let picture = folder.path().join("picture.png");
    let table = succeeded(&replica(&["inspect", text(&clouds), "--picture", text(&picture), "--by", "intensity"]));
    assert!(table.contains("points"), "{table}");
    let png = std::fs::read(&picture).expect("a picture");
    assert!(png.starts_with(b"\x89PNG") && png.len() > 10_000, "{} bytes", png.len());
}

#[test]
fn custom_rig_is_simulated_and_invalid_rig_is_reported_completely() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("mine.toml");
    let drive = folder.path().join("drive");
    let rig =
        "name = \"mine\"\nbody_height_m = 0.5\n[lidar]\nmodel = \"hdl32e\"\nmounting = { position = [0, 0, 2] }\n";
    let simulate = |error: &str| {
        let to = ["--seconds", "0.3", "--out", text(&drive)];
        replica(&[&["simulate", "--rig", text(&file), "--calibration-error", error][..], &to].concat())
    };
    std::fs::write(&file, rig.replace("0.5", "5").replace("hdl32e", "hdl")).expect("written");
    let output = simulate("0,0");
    let said = printed(&output);
    assert_eq!(output.status.code(), Some(78), "{said}");
    assert!(said.contains("mine.toml:2: body_height_m: value 5 must be 0 to 3"), "{said}");
    assert!(said.contains("mine.toml:4: lidar.model: value \"hdl\" must be one of"), "{said}");
    assert!(!drive.exists());

    std::fs::write(&file, rig).expect("written");
    assert_eq!(simulate("0.1").status.code(), Some(2), "needs two numbers");
    succeeded(&simulate("0.2,1"));
    assert!(drive.join("lidar").is_dir() && !drive.join("camera").exists() && !drive.join("gnss.nmea").exists());
    let read = |name: &str| std::fs::read_to_string(drive.join(name)).expect("a text");
    let height = |text: &str| {
        let table: toml::Table = text.parse().expect("TOML");
        let lidar = table.get("lidar").and_then(toml::Value::as_table).unwrap_or(&table);
        lidar["body_from_lidar"]["translation"][2].as_float().expect("a number")
    };
    let nominal = height(&read("drive.toml"));
    let actual = height(&read("truth/calibration.toml"));
    assert!(nominal == 2.0 && actual != 2.0 && (actual - 2.0).abs() < 0.04, "{nominal} {actual}");
}

#[test]
fn full_disk_is_reported_and_no_files_are_left() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = folder.path().join("drive");
    // A limit on file sizes replaces a full disk: both make a write fail.
    let script = "trap '' XFSZ; ulimit -f 200; exec \"$0\" simulate --seconds 1 --out \"$1\"";
    let output = Command::new("bash")
        .args(["-c", script, env!("CARGO_BIN_EXE_replica"), text(&drive)])
        .output()
        .expect("bash starts");
    let said = printed(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("lidar/000000.pcap: cannot be written: File too large"), "{said}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0, "{said}");
}

#[test]
fn file_that_is_no_capture_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("letter.pcap");
    std::fs::write(&path, "Dear reader").expect("written");
    let output = replica(&["convert", text(&path), text(&folder.path().join("out"))]);
    assert_eq!(output.status.code(), Some(1));
    assert!(printed(&output).contains("letter.pcap"));
}

#[test]
fn imported_sweeps_are_links() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = folder.path().join("velodyne");
    let drive = folder.path().join("drive");
    std::fs::create_dir(&source).expect("made");
    for name in ["000000.bin", "000001.bin"] {
        let point = [5.0_f32, 1.0, -1.0, 0.5].map(f32::to_le_bytes).concat();
        std::fs::write(source.join(name), point.repeat(100)).expect("written");
    }
    succeeded(&replica(&["import", text(&source), text(&drive)]));
    assert!(drive.join("drive.toml").is_file());
    let lidar = std::fs::read_dir(drive.join("lidar")).expect("a folder").flatten();
    let links = lidar.filter(|entry| entry.path().is_symlink()).count();
    assert_eq!(links, 2);
}

#[test]
fn imported_bag_is_a_drive_of_its_sweeps() {
    let folder = tempfile::tempdir().expect("a folder");
    let bag = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/import/tests/bags/street_mcap");
    let drive = folder.path().join("drive");
    let wishes = ["--topic", "imu=none", "--transform", "gnss=0,0,2,0,0,0,1", "--body-frame", "mast"];
    let report = succeeded(&replica(&[&["import", bag, text(&drive)], &wishes[..]].concat()));
    assert!(report.contains("imported: 3 sweeps from /velodyne_points"), "{report}");
    assert!(report.contains("not imported: 6 messages of /imu/data (sensor_msgs/Imu)"), "{report}");
    let sweeps = std::fs::read_dir(drive.join("lidar")).expect("a folder").flatten();
    assert_eq!(sweeps.filter(|entry| entry.path().extension().is_some_and(|extension| extension == "pcd")).count(), 3);
    let output = replica(&["import", bag, text(&folder.path().join("other")), "--transform", "gnss=0,0,2"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(printed(&output).contains("must be FRAME=X,Y,Z,QX,QY,QZ,QW with seven numbers"));
}

#[test]
fn new_rig_makes_the_drive_folder_and_replaces_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = folder.path().join("drives/mine");
    let new = |out: &std::path::Path| replica(&["rig", "new", text(out), "--lidar", "vlp16", "--position", "0,0,1.8"]);
    succeeded(&new(&drive));
    let manifest = std::fs::read_to_string(drive.join("drive.toml")).expect("was written");
    assert!(manifest.contains("name = \"mine\""), "{manifest}");
    for out in [drive.clone(), drive.join("drive.toml")] {
        let again = new(&out);
        assert_eq!(again.status.code(), Some(1), "{}", printed(&again));
        assert!(printed(&again).contains("drive.toml exists already"), "{}", printed(&again));
    }
    let notes = folder.path().join("notes.txt");
    std::fs::write(&notes, "notes").expect("writes");
    assert!(printed(&new(&notes)).contains("notes.txt exists already; expected a folder"), "{}", printed(&new(&notes)));
    let other = folder.path().join("rigs/other.toml");
    succeeded(&new(&other));
    assert!(other.is_file());
}
