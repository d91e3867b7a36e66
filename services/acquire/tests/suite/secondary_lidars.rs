//! Drives with two LiDARs: an HDL-32E whose sweeps are the ticks, and a VLP-16 whose revolutions start at other times.

use crate::support::{BEGIN, N_PACKETS, range_2mm, write_lidar};
use acquire::{Acquire, Settings};
use drive::manifest::{LidarEntry, Manifest, PoseEntry};
use lidar::pcap::{PacketReader, Writer};
use lidar::velodyne::{DATA_PORT, Model, RawBlock, RawReturn, encode_data_packet};
use messages::{SweepTopic, pod};
use stage::testing::{Bench, context};
use stage::{Flow, Received, Stage};
use std::fs;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::Path;

/// Duration of a packet of the VLP-16, and of its blocks of two firings each, ns.
const PACKET_NANOS: i64 = 1_327_104;
const BLOCK_NANOS: i64 = PACKET_NANOS / 12;
/// Offset of the VLP-16, which starts before the first LiDAR and ends before it: 4 s.
const EARLY_NANOS: i64 = 137_000_000;
pub const N_REAR_PACKETS: i64 = 3014;
const REAR: SocketAddrV4 = SocketAddrV4::new(Ipv4Addr::new(192, 168, 1, 77), 2369);

/// Packets of the VLP-16 for which `keep` holds, with the stamps of their capture. Each block has its own range.
pub fn rear_packets(keep: impl Fn(i64) -> bool) -> Vec<(geometry::Stamp, Vec<u8>)> {
    let packet = |packet: i64| {
        let blocks = std::array::from_fn(|index| {
            let round = packet * 12 + index as i64;
            let azimuth = ((round * BLOCK_NANOS) as f64 * 1e-9 * 9.7).fract() * 36_000.0;
            let returns = [RawReturn { range_2mm: range_2mm(round), intensity: 7 }; 32];
            RawBlock { azimuth: azimuth as u16, is_lower: false, returns }
        });
        let stamp = BEGIN.plus_nanos(packet * PACKET_NANOS - EARLY_NANOS);
        (stamp, encode_data_packet(Model::Vlp16, stamp, &blocks).to_vec())
    };
    (0..N_REAR_PACKETS).filter(|number| keep(*number)).map(packet).collect()
}

pub fn manifest(rear: LidarEntry) -> Manifest {
    let front = LidarEntry::from_captures("hdl32e", PoseEntry::IDENTITY);
    let name = |name: &str| Some(name.to_owned());
    let rear = LidarEntry { name: name("rear"), ..rear };
    Manifest { other_lidars: vec![rear], ..Manifest::with_lidar("two", LidarEntry { name: name("front"), ..front }) }
}

fn write_manifest(folder: &Path, rear: LidarEntry) {
    fs::write(folder.join("drive.toml"), toml::to_string(&manifest(rear)).expect("encodes")).expect("writes");
}

pub fn rear_entry(folder: &str) -> LidarEntry {
    LidarEntry::new("vlp16", "pcap", folder, PoseEntry::IDENTITY)
}

/// A drive with a folder for each LiDAR.
fn drive_of(keep: impl Fn(i64) -> bool) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    write_lidar(folder.path(), |_| true);
    let mut writer = Writer::new(Vec::new()).expect("writes");
    for (stamp, payload) in rear_packets(keep) {
        writer.write_udp(stamp, DATA_PORT, &payload).expect("writes");
    }
    fs::create_dir_all(folder.path().join("rear")).expect("makes");
    fs::write(folder.path().join("rear/0.pcap"), writer.finish().expect("writes")).expect("writes");
    write_manifest(folder.path(), rear_entry("rear"));
    folder
}

fn open(folder: &Path) -> Bench<Acquire> {
    Bench::new(&Settings::default(), &context(folder)).expect("opens")
}

/// All messages of the second LiDAR, as bytes, and their ticks.
fn rear_messages(bench: &mut Bench<Acquire>) -> Vec<(usize, Vec<u8>)> {
    let mut found = Vec::new();
    for tick in 0.. {
        if bench.tick().expect("steps") == Flow::End {
            break;
        }
        for sweep in bench.take::<SweepTopic>().iter().filter(|sweep| sweep.header().lidar == 1) {
            let header = pod::bytes_from_rows(std::slice::from_ref(sweep.header()));
            let rows = pod::bytes_from_rows(sweep.rows());
            found.push((tick, [&sweep.stamp().to_le_bytes()[..], header, rows].concat()));
        }
    }
    found
}

#[test]
fn returns_of_second_lidar_are_published_in_the_tick_of_their_time() {
    let folder = drive_of(|_| true);
    let mut bench = open(folder.path());
    let end_of_rear = BEGIN.0 - EARLY_NANOS + N_REAR_PACKETS * PACKET_NANOS;
    let mut last = None::<i64>;
    let mut n_points = 0;
    for tick in 0..42 {
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
        let sweeps: Vec<Received<SweepTopic>> = bench.take::<SweepTopic>();
        let first = &sweeps[0];
        let rear = sweeps.get(1);
        let end = first.stamp() + i64::from(first.header().duration_nanos);
        assert_eq!((first.header().lidar, first.header().n_rings), (0, 32));
        assert_eq!(rear.is_some(), first.stamp() < end_of_rear, "{tick}");
        let Some(rear) = rear else { continue };
        assert_eq!((rear.header().lidar, rear.header().n_rings, rear.header().has_times), (1, 16, 1));
        assert_eq!(rear.stamp() + i64::from(rear.header().duration_nanos), end);
        for point in rear.rows() {
            let at = rear.stamp() + i64::from(point.offset_nanos);
            // Blocks are not divided.
            assert!(at >= first.stamp() && at < end + BLOCK_NANOS, "{tick}: {}", at - first.stamp());
            assert!(last.is_none_or(|last| (0..2 * BLOCK_NANOS).contains(&(at - last))), "a gap or an overlap");
            last = Some(at);
            let round = (at - BEGIN.0 + EARLY_NANOS) / BLOCK_NANOS;
            // The lasers are some millimetres off the axis.
            let range_m = point.x.hypot(point.y).hypot(point.z);
            let expected = [round - 1, round, round + 1].map(|round| f32::from(range_2mm(round)) * 0.002);
            assert!(
                expected.iter().any(|expected| (range_m - expected).abs() < 4e-3),
                "{tick}: {range_m} {expected:?}"
            );
        }
        n_points += rear.rows().len() as i64;
    }
    let n_expected = (end_of_rear - BEGIN.0) / BLOCK_NANOS * 32;
    assert!((n_points - n_expected).abs() <= 64, "{n_points}, expected {n_expected}");
    assert_eq!((bench.counter("lidar_rear_sweeps"), bench.counter("lidar_rear_sweeps_missing")), (39, 3));
    assert_eq!(bench.counter("lidar_rear_data_packets"), N_REAR_PACKETS as u64);
    assert_eq!((bench.counter("lidar_rear_points_skipped"), bench.counter("data_packets") > 0), (0, true));
}

#[test]
fn restart_between_ticks_gives_the_same_bytes_of_second_lidar() {
    let folder = drive_of(|_| true);
    let settings = Settings::default();
    let reference = rear_messages(&mut open(folder.path()));
    assert_eq!(reference.len(), 39);
    for cut in [0, 1, 2, 17, 38, 41] {
        let mut bench = open(folder.path());
        for _ in 0..cut {
            bench.tick().expect("steps");
            bench.take::<SweepTopic>();
        }
        let mut bench = bench.restarted(&settings, &context(folder.path())).expect("restarts");
        let found: Vec<_> = rear_messages(&mut bench).into_iter().map(|(tick, bytes)| (tick + cut, bytes)).collect();
        assert!(found == reference[cut.min(39)..], "cut at {cut}");
        assert_eq!(bench.counter("lidar_rear_data_packets"), N_REAR_PACKETS as u64);
    }
    let state = {
        let mut bench = open(folder.path());
        bench.tick().expect("steps");
        bench.stage.save().expect("saves").to_vec()
    };
    let alone = Manifest { other_lidars: Vec::new(), ..manifest(rear_entry("rear")) };
    fs::write(folder.path().join("drive.toml"), toml::to_string(&alone).expect("encodes")).expect("writes");
    assert!(open(folder.path()).stage.load(&state).is_err(), "the state of a drive with two LiDARs");
}

#[test]
fn lidars_in_one_capture_are_told_apart_and_give_the_same_sweeps() {
    let folder = drive_of(|_| true);
    let reference = rear_messages(&mut open(folder.path()));
    let mut front = PacketReader::open(&folder.path().join("lidar/0.pcap")).expect("opens");
    let mut all = Vec::new();
    while let Some(packet) = front.next().expect("reads") {
        all.push((packet.stamp, packet.source, packet.port, packet.payload.to_vec()));
    }
    all.extend(rear_packets(|_| true).into_iter().map(|(stamp, payload)| (stamp, REAR, REAR.port(), payload)));
    all.sort_by_key(|(stamp, ..)| *stamp);
    let mut writer = Writer::new(Vec::new()).expect("writes");
    for (stamp, source, port, payload) in all {
        let target = SocketAddrV4::new(Ipv4Addr::BROADCAST, port);
        writer.write_datagram(stamp, source, target, &payload).expect("writes");
    }
    fs::write(folder.path().join("lidar/0.pcap"), writer.finish().expect("writes")).expect("writes");
    let by_model = rear_entry("lidar");
    let by_sender = LidarEntry { sender: Some(*REAR.ip()), ..rear_entry("lidar") };
    let by_port = LidarEntry { port: Some(REAR.port()), ..rear_entry("lidar") };
    for entry in [by_model, by_sender, by_port] {
        write_manifest(folder.path(), entry.clone());
        let mut bench = open(folder.path());
        assert!(rear_messages(&mut bench) == reference, "{entry:?}");
        bench.finish().expect("finishes");
        assert_eq!(bench.counter("data_packets"), N_PACKETS as u64);
        // Packets of the other LiDAR are not foreign.
        assert_eq!(
            (bench.counter("foreign_packets"), bench.counter("lidar_rear_foreign_packets")),
            (0, 0),
            "{entry:?}"
        );
        assert_eq!(bench.doubt("foreign_packets"), None);
    }
}

#[test]
fn gaps_of_second_lidar_are_counted_and_doubted_with_its_name() {
    // Half a second in the middle.
    let folder = drive_of(|packet| !(1000..1377).contains(&packet));
    let mut bench = open(folder.path());
    assert_eq!(rear_messages(&mut bench).len(), 35);
    bench.finish().expect("finishes");
    assert_eq!(bench.counter("lidar_rear_lost_packets"), 377);
    assert_eq!(bench.counter("lidar_rear_sweeps_missing"), 7);
    let share = bench.doubt("missing_sweeps_rear").expect("a doubt");
    assert!((share - 7.0 / 42.0).abs() < 1e-9, "{share}");
    assert_eq!((bench.doubt("silent_sensors"), bench.doubt("missing_sweeps")), (None, None));
}

#[test]
fn absent_second_lidar_is_a_silent_sensor() {
    let folder = drive_of(|_| true);
    fs::remove_file(folder.path().join("rear/0.pcap")).expect("removes");
    let mut bench = open(folder.path());
    assert!(rear_messages(&mut bench).is_empty());
    bench.finish().expect("finishes");
    assert_eq!(bench.doubt("silent_sensors"), Some(1.0));
    // Packets of another device.
    let mut writer = Writer::new(Vec::new()).expect("writes");
    writer.write_udp(BEGIN, DATA_PORT, b"no LiDAR").expect("writes");
    fs::write(folder.path().join("rear/0.pcap"), writer.finish().expect("writes")).expect("writes");
    let mut bench = open(folder.path());
    assert!(rear_messages(&mut bench).is_empty());
    bench.finish().expect("finishes");
    assert_eq!(bench.doubt("silent_sensors"), Some(1.0));
}
