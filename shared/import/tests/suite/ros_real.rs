//! Imports of real bags with packets. The expected checksums of their packets were computed with the Python package rosbags.

use super::support::{folder, import_from};
use drive::Drive;
use geometry::{Point3, Vector3};
use lidar::Model;
use std::path::Path;

/// Bytes of a capture before its first record.
const FILE: usize = 24;
/// Bytes of a record before its packet.
const RECORD: usize = 16;
/// Bytes of the headers of a packet.
const HEADERS: usize = 42;

/// Number and checksum of the packets of a capture, each with the µs of its arrival.
fn sum(capture: &Path) -> (usize, u32) {
    let bytes = std::fs::read(capture).expect("reads");
    let mut rest = &bytes[FILE..];
    let mut n = 0;
    let mut hasher = crc32fast::Hasher::new();
    while !rest.is_empty() {
        let word = |at: usize| u32::from_le_bytes(rest[at..at + 4].try_into().expect("four bytes"));
        let micros = u64::from(word(0)) * 1_000_000 + u64::from(word(4));
        let length = word(8) as usize;
        hasher.update(&micros.to_le_bytes());
        hasher.update(&rest[RECORD + HEADERS..RECORD + length]);
        rest = &rest[RECORD + length..];
        n += 1;
    }
    (n, hasher.finalize())
}

#[real_data::test("lidars/nebula")]
fn packets_of_real_ros2_bags_are_those_that_rosbags_reads() {
    for (name, model, n, crc) in [
        ("40p/1673400149412331409", "pandar40p", 1439, 0x4f1c_67c3),
        ("qt64/1673401195788312575", "pandarqt64", 1200, 0x3bed_8000),
        ("vlp16/1673400471837873222", "vlp16", 603, 0xed84_7b13),
        ("vlp32/1713492677464078412", "vlp32c", 379, 0xdb98_5779),
        ("xt32/1673400677802009732", "pandarxt32", 2000, 0xfa09_0926),
    ] {
        let folder = folder();
        let import = import_from(real_data::path(&format!("lidars/nebula/{name}")), &folder);
        let report = import.run().unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(report[0].ends_with(&format!("1 capture of {model} (ROS bag)")), "{report:?}");
        assert!(report[1].starts_with(&format!("imported: {n} packets from /")), "{report:?}");
        assert_eq!(sum(&import.out.join("lidar/packets.pcap")), (n, crc), "{name}");
        // The file alone is also a bag.
        let file = Path::new(name).file_name().expect("has one").to_string_lossy().into_owned();
        let mut of_file = import_from(real_data::path(&format!("lidars/nebula/{name}/{file}_0.db3")), &folder);
        of_file.out = folder.path().join("file");
        of_file.run().expect("imports");
        assert_eq!(sum(&of_file.out.join("lidar/packets.pcap")), (n, crc), "{name}");
    }
}

/// The points of real bags equal the driver's cloud of the revolution, in the frame of the driver.
#[real_data::test("lidars/nebula")]
fn points_of_real_bags_are_those_of_the_driver_in_its_frame() {
    for (bag, cloud, calibration, turn, min_m) in [
        ("40p/1673400149412331409", "40p/1673400149711850138.pcd", "Pandar40P.csv", 2, 0.3),
        ("xt32/1673400677802009732", "xt32/1673400678101968885.pcd", "PandarXT32.csv", 3, 0.05),
        ("qt64/1673401195788312575", "qt64/1673401196087570870.pcd", "PandarQT64.csv", 2, 0.1),
    ] {
        let folder = folder();
        let mut import = import_from(real_data::path(&format!("lidars/nebula/{bag}")), &folder);
        import.options.ros.calibration = Some(real_data::path(&format!("lidars/nebula/calibration/{calibration}")));
        import.run().unwrap_or_else(|error| panic!("{bag}: {error}"));
        let drive = Drive::open(&import.out).expect("opens");
        let body_from_lidar = drive.rig().body_from_lidar;
        let mut sweeps = drive.sweeps().expect("opens");
        let mut ours = Vec::new();
        let mut points = Vec::new();
        while let Some(info) = sweeps.next_sweep(|piece| points.extend_from_slice(piece)).expect("reads") {
            for point in points.drain(..) {
                // The driver cuts revolutions by the direction of each point, the sweep by the encoder.
                let encoder = f64::from(point.azimuth) / 36_000.0;
                let direction = f64::from(-point.y).atan2(f64::from(point.x)) / std::f64::consts::TAU;
                let at = info.seq as f64 + encoder + (direction - encoder + 0.5).rem_euclid(1.0) - 0.5;
                let p = Point3::new(f64::from(point.x), f64::from(point.y), f64::from(point.z));
                if at.floor() as i64 == turn && p.coords.norm() > min_m - 1e-4 {
                    ours.push(body_from_lidar * p);
                }
            }
        }
        let bytes = std::fs::read(real_data::path(&format!("lidars/nebula/{cloud}"))).expect("reads");
        let theirs = formats::pcd::points_from_pcd(&bytes).expect("decodes");
        assert_eq!(ours.len(), theirs.len(), "{bag}");
        let n = ours.len() as f64;
        let center: Vector3<f64> = ours.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
        let of_theirs = theirs.iter().map(|p| Vector3::new(f64::from(p.x), f64::from(p.y), f64::from(p.z)));
        let their_center = of_theirs.sum::<Vector3<f64>>() / n;
        assert!((center - their_center).norm() < 1e-4, "{bag}: {center} {their_center}");
    }
}

#[real_data::test("lidars/ouster/512x10_raw.bag")]
fn real_ros1_bag_of_an_ouster_is_decoded_with_its_metadata() {
    let folder = folder();
    let import = import_from(real_data::path("lidars/ouster/512x10_raw.bag"), &folder);
    let report = import.run().expect("imports");
    assert!(report[0].ends_with("1 capture of ouster (ROS bag)"), "{report:?}");
    assert!(report[1].starts_with("imported: 32 packets from /os_node0/lidar_packets"), "{report:?}");
    assert!(
        report.iter().any(|line| line.starts_with("not imported: 10 messages of /os_node0/imu_packets")),
        "{report:?}"
    );
    assert_eq!(sum(&import.out.join("lidar/packets.pcap")), (32, 0xd4c8_a58e));
    let drive = Drive::open(&import.out).expect("opens");
    assert_eq!(
        (drive.model(), drive.manifest().lidar.calibration.as_deref()),
        (Model::Ouster, Some("lidar/metadata.json"))
    );
    let mut sweeps = drive.sweeps().expect("opens");
    let mut n_returns = 0;
    while let Some(info) = sweeps.next_sweep(|_| {}).expect("reads") {
        assert!(info.has_times);
        n_returns += info.n_returns;
    }
    assert!(n_returns > 1000, "{n_returns}");
    assert!(!sweeps.lidar_stats().has_lost_data(), "{:?}", sweeps.lidar_stats());
}
