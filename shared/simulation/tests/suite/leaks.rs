//! Ground truth stays in `truth/`: sensor files contain no information that is only available in the simulator.

use crate::support::{files, udp_payloads};
use drive::manifest::Manifest;
use messages::ClassId;
use simulation::{CalibrationError, DriveSpec, RigSpec, Simulation, write_simulation};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

/// A vehicle with one sensor of each kind and small images, for a fast simulation.
fn small_rig() -> RigSpec {
    let text = r#"
name = "small"
body_height_m = 0.8
[lidar]
model = "hdl32e"
mounting = { position = [0.0, 0.0, 1.5] }
[trigger]
rate_hz = 4.0
way_m = 0.0
[[camera]]
name = "ahead"
exposure_nanos = 1_000_000
mounting = { position = [0.5, 0.0, 1.2] }
lens = { kind = "pinhole", width = 160, height = 120, fx = 80.0, fy = 80.0, cx = 79.5, cy = 59.5 }
[[mosaic]]
name = "right"
sensor = "hs03"
mounting = { position = [0.0, -0.5, 1.2], yaw_deg = -90.0 }
lens = { kind = "pinhole", width = 2048, height = 1088, fx = 1000.0, fy = 1000.0, cx = 1023.5, cy = 543.5 }
[gnss]
receiver = "single_frequency"
antenna_in_body = [0.0, 0.0, 1.0]
[imu]
grade = "mems"
rate_hz = 100.0
"#;
    RigSpec::from_toml(Path::new("small.toml"), text).expect("sound")
}

fn spec(seed: u64, calibration_error: CalibrationError) -> DriveSpec {
    DriveSpec { rig: small_rig(), lidar_step: 5, calibration_error, ..DriveSpec::urban(seed, 0.6) }
}

type Files = BTreeMap<String, Vec<u8>>;

/// Sensor files and truth files of a drive.
fn write(simulation: &Simulation) -> (Files, Files) {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("drive");
    write_simulation(simulation, &out, &mut |_| ()).expect("a drive");
    files(&out).into_iter().partition(|(name, _)| !name.starts_with("truth/"))
}

/// Sensor files and truth files of the drive with seed 4 and nominal mountings.
static DRIVE: LazyLock<(Simulation, Files, Files)> = LazyLock::new(|| {
    let simulation = Simulation::new(&spec(4, CalibrationError::default())).expect("a town");
    let (sensors, truth) = write(&simulation);
    (simulation, sensors, truth)
});

/// Replaces every class and every instance by another one.
fn shuffled(class: ClassId, instance: u16) -> (ClassId, u16) {
    let next = (class as usize + 7) % ClassId::ALL.len();
    (ClassId::ALL[next], if instance == 0 { 500 } else { instance - 1 })
}

#[test]
fn relabeled_town_gives_identical_sensor_files() {
    let (simulation, sensors, truth) = &*DRIVE;
    let renamed = Simulation {
        spec: simulation.spec.clone(),
        scene: simulation.scene.clone().relabeled(shuffled),
        motion: simulation.motion.clone(),
        rig: simulation.rig.clone(),
    };
    let (sensors_renamed, truth_renamed) = write(&renamed);
    for (name, bytes) in sensors {
        assert!(sensors_renamed[name] == *bytes, "{name} depends on classes or instances");
    }
    assert_eq!(sensors.len(), sensors_renamed.len());
    for part in ["lidar/", "camera/0/", "right/", "right/dark/", "gnss.nmea", "imu.csv", "drive.toml"] {
        assert!(sensors.keys().any(|name| name.starts_with(part)), "{part} was not written");
    }
    // The relabeling must change the ground truth; otherwise the test is void.
    let (labels, others): (Vec<&String>, Vec<&String>) =
        truth.keys().partition(|name| name.starts_with("truth/labels/"));
    assert!(labels.len() >= 6 && labels.iter().all(|name| truth[*name] != truth_renamed[*name]));
    assert!(others.iter().any(|name| name.contains("trajectory")), "{others:?}");
    assert!(others.iter().all(|name| truth[*name] == truth_renamed[*name]), "poses do not depend on names");
}

#[test]
fn manifest_does_not_depend_on_true_mountings() {
    let of = |seed: u64| {
        let error = CalibrationError { rotation_deg: 0.5, translation_m: 0.02 };
        let (sensors, truth) = write(&Simulation::new(&spec(seed, error)).expect("a town"));
        let manifest = String::from_utf8(sensors["drive.toml"].clone()).expect("text");
        let manifest: Manifest = toml::from_str(&manifest).expect("a manifest");
        (Manifest { name: String::new(), ..manifest }, truth["truth/calibration.toml"].clone())
    };
    let (one, true_one) = of(1);
    let (other, true_other) = of(2);
    assert_eq!(one, other, "mountings in drive.toml are the nominal ones");
    assert!(true_one != true_other, "each drive has its own true mountings");
}

#[test]
fn images_and_packets_contain_no_spare_bytes() {
    let (_, sensors, _) = &*DRIVE;
    let part = |prefix: &str| sensors.iter().filter(|(name, _)| name.starts_with(prefix)).collect::<Vec<_>>();
    for (name, bytes) in part("camera/") {
        // Segments before the scan: marker, length. JFIF, tables, frame; neither Exif nor comment.
        let mut at = 2;
        while bytes[at + 1] != 0xda {
            assert!([0xe0, 0xdb, 0xc0, 0xc4].contains(&bytes[at + 1]), "{name}: segment {:x}", bytes[at + 1]);
            at += 2 + usize::from(u16::from_be_bytes([bytes[at + 2], bytes[at + 3]]));
        }
    }
    for (name, bytes) in
        part("right/").into_iter().filter(|(name, _)| name.rsplit_once('.').is_some_and(|(_, kind)| kind == "pgm"))
    {
        assert_eq!(bytes.len(), b"P5\n2048 1088\n1023\n".len() + 2048 * 1088 * 2, "{name}");
    }
    let lidar = part("lidar/");
    let mut last = None;
    for (port, payload) in udp_payloads(lidar[0].1) {
        match port {
            2368 => {
                // 12 blocks of flag, angle and 32 returns of range and intensity; time; mode and model.
                assert_eq!((payload.len(), &payload[1204..]), (1206, &[0x37, 0x21][..]));
                let blocks = payload[..1200].chunks_exact(100);
                assert!(blocks.clone().all(|block| block[..2] == [0xff, 0xee]));
                for block in blocks {
                    // Angles advance with the motor, 0.17 deg from round to round, with the noise of the encoder.
                    let azimuth = i32::from(u16::from_le_bytes([block[2], block[3]]));
                    let step = last.map_or(17, |last: i32| (azimuth - last).rem_euclid(36_000));
                    assert!((12..=21).contains(&step), "{step}");
                    last = Some(azimuth);
                    for part in block[4..].chunks_exact(3) {
                        assert!(part[..2] != [0, 0] || part[2] == 0, "a missing return has no intensity");
                    }
                }
            }
            _ => assert_eq!((port, payload.len()), (8308, 512)),
        }
    }
}
