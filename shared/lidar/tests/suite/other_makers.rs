//! Packets of Robosense and Livox, built here from the published formats: no captures of them are available for tests.

use crate::support::sweeps;
use geometry::Stamp;
use lidar::pcap::Writer;
use lidar::{Lidar, Model, SweepPoint, SweepReader};
use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::{Path, PathBuf};

/// 2023-11-14 22:13:20 UTC.
const BEGIN: Stamp = Stamp(1_700_000_000_000_000_000);

/// Capture times, ports of sender and receiver, and payloads.
fn write(path: &Path, packets: impl IntoIterator<Item = (Stamp, u16, Vec<u8>)>) -> PathBuf {
    let mut writer = Writer::new(Vec::new()).expect("writes");
    for (stamp, port, payload) in packets {
        let [source, target] = [port - 1, port].map(|port| SocketAddrV4::new(Ipv4Addr::new(192, 168, 1, 200), port));
        writer.write_datagram(stamp, source, target, &payload).expect("writes");
    }
    std::fs::write(path, writer.finish().expect("writes")).expect("writes");
    path.to_owned()
}

/// A packet of an RS-LiDAR with these angles of its blocks; `returns` gives range in 5 mm and intensity by block and return.
fn robosense(model: u8, nanos: i64, angles: [u16; 12], returns: impl Fn(usize, usize) -> (u16, u8)) -> Vec<u8> {
    let mut bytes = vec![0x55, 0xaa, 0x05, 0x0a, 0x5a, 0xa5, 0x50, 0xa0];
    bytes.resize(20, 0);
    bytes.extend([23, 11, 14, 22, 13, 20 + (nanos / 1_000_000_000) as u8]);
    bytes.extend(((nanos / 1_000_000 % 1000) as u16).to_be_bytes());
    bytes.extend(((nanos / 1000 % 1000) as u16).to_be_bytes());
    bytes.push(model);
    bytes.resize(42, 0);
    for (block, angle) in angles.into_iter().enumerate() {
        bytes.extend([0xff, 0xee]);
        bytes.extend(angle.to_be_bytes());
        for number in 0..32 {
            let (range, intensity) = returns(block, number);
            bytes.extend(range.to_be_bytes());
            bytes.push(intensity);
        }
    }
    bytes.resize(1248, 0);
    bytes
}

/// Encoder angle after ns at ten revolutions per second.
fn angle_at(nanos: i64) -> u16 {
    (nanos * 36 / 100_000 % 36_000) as u16
}

fn check_direction(point: &SweepPoint, range_m: f32, elevation_deg: f32, azimuth_deg: f32, radius_m: f32) {
    let elevation = elevation_deg.to_radians();
    let azimuth = azimuth_deg.to_radians();
    let across = range_m * elevation.cos() + radius_m;
    let expected = [across * azimuth.cos(), -across * azimuth.sin(), range_m * elevation.sin()];
    let off = [point.x - expected[0], point.y - expected[1], point.z - expected[2]].map(f32::abs);
    assert!(off.iter().all(|off| *off < 1e-4 * range_m), "{point:?} for {expected:?}");
}

#[test]
fn rs16_packets_decode_to_revolutions() {
    let folder = tempfile::tempdir().expect("a folder");
    let packet = |number: i64| {
        let nanos = number * 12 * 111_000;
        let angles = std::array::from_fn(|block| angle_at(nanos + block as i64 * 111_000));
        let returns =
            |block: usize, laser: usize| if laser == 5 { (0, 9) } else { (1000 + 40 * laser as u16, block as u8) };
        (BEGIN.plus_nanos(nanos + 1_700_000), 6699, robosense(1, nanos, angles, returns))
    };
    let device = [&[0xa5, 0xff, 0x00, 0x5a, 0x11, 0x11, 0x55, 0x55][..], &[0; 1240]].concat();
    let packets = (0..200).map(packet).chain([(BEGIN.plus_nanos(300_000_000), 7788, device)]);
    let path = write(&folder.path().join("a.pcap"), packets);
    let mut reader = SweepReader::open(vec![path.clone()], None).expect("opens");
    assert_eq!((reader.model().name(), reader.n_rings()), ("rs16", 16));
    let sweeps = sweeps(&mut reader);
    let stats = reader.stats();
    assert!(!stats.has_lost_data() && stats.data_packets == 200, "{stats:?}");
    assert_eq!(sweeps.len(), 3);
    let (info, returns) = &sweeps[1];
    assert!((i64::from(info.duration_nanos) - 100_000_000).abs() < 111_000, "{info:?}");
    assert!((info.stamp.0 - BEGIN.0 - 100_000_000).abs() < 111_000, "the sensor's clock is near the capture's");
    assert_eq!(returns.len() % 31, 0);
    // Lasers 0 to 7 look from -15 deg up, lasers 8 to 15 from +15 deg down, in steps of 2.8 µs.
    for (place, laser, elevation_deg, ring) in
        [(0, 0, -15.0, 0), (7, 8, 15.0, 15), (14, 15, 1.0, 8), (15, 16, -15.0, 0)]
    {
        let point = &returns[31 * 40 + place];
        let nanos = (laser % 16) * 2800 + laser / 16 * 55_500;
        assert_eq!(i64::from(point.offset_nanos) - i64::from(returns[31 * 40].offset_nanos), nanos);
        let azimuth_deg = f32::from(point.azimuth) / 100.0;
        assert!((azimuth_deg - f32::from(returns[31 * 40].azimuth) / 100.0 - nanos as f32 * 3.6e-6).abs() < 0.011);
        check_direction(point, (1000.0 + 40.0 * laser as f32) * 0.005, elevation_deg, azimuth_deg, 0.038_25);
        assert_eq!(point.ring, ring);
    }
    // The model of the packets is not the one of the manifest.
    let found = lidar::OtherModel::find(&[path], &lidar::velodyne::Model::Hdl32e.into()).expect("reads");
    let found = found.expect("another model").to_string();
    assert!(found.contains("packet 1: has the size and the header of a RS-LiDAR-16"), "{found}");
}

#[test]
fn rs16_blocks_with_two_echoes_are_recognized() {
    let folder = tempfile::tempdir().expect("a folder");
    let packet = |number: i64| {
        let nanos = number * 12 * 55_500;
        let angles = std::array::from_fn(|block| angle_at(nanos + block as i64 * 55_500));
        // One shot in eight has a second echo.
        let returns = |block: usize, laser: usize| match laser {
            16 => (4000, block as u8),
            _ => (1000 + 40 * (laser % 16) as u16, block as u8),
        };
        (BEGIN.plus_nanos(nanos + 900_000), 6699, robosense(1, nanos, angles, returns))
    };
    let path = write(&folder.path().join("a.pcap"), (0..400).map(packet));
    let mut reader = SweepReader::open(vec![path], None).expect("opens");
    let sweeps = sweeps(&mut reader);
    assert!(!reader.stats().has_lost_data(), "{:?}", reader.stats());
    let returns = &sweeps[1].1;
    assert_eq!(returns.len() % 17, 0);
    let first = &returns[0];
    let second = &returns[16];
    assert_eq!((first.offset_nanos, first.azimuth, first.ring), (second.offset_nanos, second.azimuth, second.ring));
    check_direction(second, 20.0, -15.0, f32::from(second.azimuth) / 100.0, 0.038_25);
}

#[test]
fn rs32_needs_the_angles_of_its_unit() {
    let folder = tempfile::tempdir().expect("a folder");
    let packet = |number: i64| {
        let nanos = number * 12 * 55_520;
        let angles = std::array::from_fn(|block| angle_at(nanos + block as i64 * 55_520));
        (BEGIN.plus_nanos(nanos), 6699, robosense(2, nanos, angles, |_, laser| (2000, laser as u8)))
    };
    let path = write(&folder.path().join("a.pcap"), (0..300).map(packet));
    let model = Model::from_name("rs32").expect("a model");
    let error = SweepReader::open(vec![path.clone()], Some(&model.into())).expect_err("has no angles").to_string();
    assert!(error.contains("rs32, which needs the angle file (CSV) of the unit"), "{error}");
    let angles = (0..32).fold(String::new(), |text, laser| text + &format!("{},{}\n", laser - 16, laser % 2));
    let lidar = Lidar::with_calibration(model, "angle.csv", angles).expect("reads");
    let mut reader = SweepReader::open(vec![path], Some(&lidar)).expect("opens");
    let sweeps = sweeps(&mut reader);
    let returns = &sweeps[1].1;
    for (laser, nanos) in [(0, 0), (15, 44_640), (16, 1_440), (31, 46_080)] {
        let point = &returns[320 + laser];
        assert_eq!(point.offset_nanos - returns[320].offset_nanos, nanos);
        let azimuth_deg = f32::from(point.azimuth) / 100.0;
        let elevation = (laser as f32 - 16.0).to_radians();
        let turned = (azimuth_deg + (laser % 2) as f32).to_radians();
        let expected_x = 10.0 * elevation.cos() * turned.cos() + 0.039_97 * azimuth_deg.to_radians().cos();
        assert!((point.x - expected_x).abs() < 1e-4, "{point:?} {expected_x}");
        assert_eq!((usize::from(point.ring), usize::from(point.intensity)), (laser, laser));
    }
}

/// A packet with the state of an RS-LiDAR-32 whose lasers look from -16 deg up by 1.25 deg, each to the right by 0 or 1 deg.
fn rs32_device() -> Vec<u8> {
    let mut bytes = vec![0xa5, 0xff, 0x00, 0x5a, 0x11, 0x11, 0x55, 0x55];
    bytes.resize(468, 0);
    let mut angle = |thousandths: i32| {
        bytes.push(u8::from(thousandths < 0));
        bytes.extend((thousandths.unsigned_abs() as u16).to_be_bytes());
    };
    for laser in 0..32 {
        angle(1250 * laser - 16_000);
    }
    for laser in 0..32 {
        angle(1000 * (laser % 2));
    }
    bytes.resize(1248, 0);
    bytes
}

#[test]
fn rs32_takes_the_angles_of_its_device_packets() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = |number: i64| {
        let nanos = number * 12 * 55_520;
        let angles = std::array::from_fn(|block| angle_at(nanos + block as i64 * 55_520));
        (BEGIN.plus_nanos(nanos), 6699, robosense(2, nanos, angles, |_, laser| (2000, laser as u8)))
    };
    let device = |number: i64| (BEGIN.plus_nanos(number * 12 * 55_520 + 1), 7788, rs32_device());
    let packets = (0..300).flat_map(|number| [Some(data(number)), (number == 100).then(|| device(number))]).flatten();
    let path = write(&folder.path().join("a.pcap"), packets);

    let text = (0..32)
        .fold(String::new(), |text, laser| text + &format!("{},{}\n", f64::from(laser) * 1.25 - 16.0, laser % 2));
    let model = Model::from_name("rs32").expect("a model");
    let of_file = Lidar::with_calibration(model, "angle.csv", text).expect("reads");
    let of = |lidar: &Lidar| sweeps(&mut SweepReader::open(vec![path.clone()], Some(lidar)).expect("opens"));
    let expected = of(&of_file);
    assert!(expected.len() > 1);
    assert_eq!(of(&model.into()), expected);

    // A LiDAR without the file takes them from the packets of a recording, so the number of rings is known before the first sweep.
    let recorded = Lidar::from(model).with_calibration_of(std::slice::from_ref(&path));
    assert_eq!((recorded.n_rings(), recorded.rings()), (32, of_file.rings()));

    // A file takes precedence over the packets, and packets of another device are ignored.
    let other = (0..32).fold(String::new(), |text, laser| text + &format!("{},0\n", laser - 16));
    let other = Lidar::with_calibration(model, "angle.csv", other).expect("reads");
    assert_eq!(other.with_device_packet(&rs32_device()), None);
    assert_ne!(of(&other), expected);
}

/// A packet of a Mid-360 with points in mm.
fn mid360(nanos: i64, points: &[[i32; 3]]) -> Vec<u8> {
    let mut bytes = vec![0];
    bytes.extend((36 + 14 * points.len() as u16).to_le_bytes());
    // Points follow each other in 5 µs.
    bytes.extend(((points.len() as u16 - 1) * 50).to_le_bytes());
    bytes.extend((points.len() as u16).to_le_bytes());
    bytes.resize(10, 0);
    bytes.push(1);
    bytes.resize(28, 0);
    bytes.extend(nanos.to_le_bytes());
    for (number, point) in points.iter().enumerate() {
        bytes.extend(point.iter().flat_map(|mm| mm.to_le_bytes()));
        bytes.extend([number as u8, 0]);
    }
    bytes
}

#[test]
fn mid360_sweeps_are_tenths_of_a_second_without_rings() {
    let folder = tempfile::tempdir().expect("a folder");
    // The clock of the sensor started with the sensor.
    let start = 7_040_000_000;
    let step = 96 * 5_000;
    let packet = |number: i64| {
        let point = |k: i64| [1000 * (k as i32 % 30 - 15), 5000, -1700 + 10 * k as i32];
        let mut points: Vec<[i32; 3]> = (0..96).map(point).collect();
        points[3] = [0, 0, 0];
        (BEGIN.plus_nanos(number * step + number % 3 * 40_000), 56_301, mid360(start + number * step, &points))
    };
    let imu = (0..40).map(|number| (BEGIN.plus_nanos(number * 5_000_000), 56_401, vec![0; 60]));
    let mut packets: Vec<_> = (0..1000).map(packet).chain(imu).collect();
    packets.sort_by_key(|packet| packet.0);
    let path = write(&folder.path().join("a.pcap"), packets);
    let mut reader = SweepReader::open(vec![path], None).expect("opens");
    assert_eq!((reader.model().name(), reader.n_rings()), ("mid360", 0));
    let sweeps = sweeps(&mut reader);
    let stats = reader.stats();
    assert!(!stats.has_lost_data() && stats.foreign_packets == 0, "{stats:?}");
    assert_eq!((stats.data_packets, stats.position_packets, stats.clock_jumps), (1000, 40, 0));
    assert_eq!(sweeps.len(), 5);
    for (info, returns) in &sweeps[1..4] {
        assert!((i64::from(info.duration_nanos) - 100_000_000).abs() <= step, "{info:?}");
        // The capture determines the start of the clock, so sweeps begin at tenths of its seconds.
        assert!(info.stamp.0 % 100_000_000 < step && info.turn > 0.98, "{info:?}");
        assert!(returns.len() > 10_000 && returns.len().is_multiple_of(95), "{}", returns.len());
        assert!(returns.windows(2).all(|pair| pair[0].offset_nanos < pair[1].offset_nanos));
        assert!(returns.iter().all(|point| point.ring == 0));
        let point = &returns[95 + 3];
        let before = &returns[95 + 2];
        assert_eq!(([point.x, point.y, point.z], point.intensity), ([-11.0, 5.0, -1.66], 4));
        assert_eq!(point.offset_nanos - before.offset_nanos, 10_000);
        assert!((f32::from(point.azimuth) / 100.0 - (360.0 - 5.0_f32.atan2(-11.0).to_degrees())).abs() < 0.01);
    }
}

#[test]
fn avia_packets_with_two_echoes_and_spherical_points_decode() {
    let folder = tempfile::tempdir().expect("a folder");
    let header = |kind: u8, nanos: i64| {
        let mut bytes = vec![5, 0, 0, 0, 0, 0, 0, 0, 1, kind];
        bytes.extend(nanos.to_le_bytes());
        bytes
    };
    let dual = |number: i64| {
        let mut bytes = header(4, BEGIN.0 + number * 200_000);
        for shot in 0..48_i32 {
            // The second echo comes from a wall further away, or repeats the first one.
            for far in [0, if shot % 2 == 0 { 500 } else { 0 }] {
                bytes.extend([3000 + far, 10 * shot, 20 * shot].iter().flat_map(|mm: &i32| mm.to_le_bytes()));
                bytes.extend([shot as u8, 0]);
            }
        }
        (BEGIN.plus_nanos(number * 200_000), 55_100, bytes)
    };
    let path = write(&folder.path().join("a.pcap"), (0..1500).map(dual));
    let mut reader = SweepReader::open(vec![path], None).expect("opens");
    assert_eq!(reader.model().name(), "avia");
    let of_dual = sweeps(&mut reader);
    assert_eq!((of_dual.len(), of_dual[0].1.len()), (3, 500 * 72));
    assert_eq!(of_dual[1].0.stamp, BEGIN.plus_nanos(100_000_000));
    let echoes = &of_dual[0].1[..2];
    assert_eq!((echoes[0].x, echoes[1].x, echoes[0].offset_nanos), (3.0, 3.5, echoes[1].offset_nanos));

    let spherical = |number: i64| {
        let mut bytes = header(3, BEGIN.0 + number * 400_000);
        for _ in 0..96 {
            bytes.extend(20_000_u32.to_le_bytes());
            // 10 deg below the horizon, 30 deg to the left.
            bytes.extend([10_000_u16, 3_000].iter().flat_map(|angle| angle.to_le_bytes()));
            bytes.extend([77, 0]);
        }
        (BEGIN.plus_nanos(number * 400_000), 55_100, bytes)
    };
    let path = write(&folder.path().join("b.pcap"), (0..300).map(spherical));
    let of_spherical = sweeps(&mut SweepReader::open(vec![path], None).expect("opens"));
    let point = &of_spherical[0].1[10];
    check_direction(point, 20.0, -10.0, -30.0, 0.0);
    assert_eq!((point.azimuth, point.intensity), (33_000, 77));
}
