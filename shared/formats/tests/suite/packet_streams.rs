//! Packet streams as networks deliver them: complete, lossy, duplicated, mixed with other traffic.

use crate::support::{BEGIN, hdl32e_packets, open, sweeps, write_capture};
use formats::velodyne::{LidarStats, Model, PulseStatus, SweepError, SweepReader, encode_position_packet};

/// Three whole revolutions and a bit: 180.84 packets each.
const N_PACKETS: usize = 560;

#[test]
fn encoded_packets_decode_to_points_with_their_times() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = hdl32e_packets(N_PACKETS);
    let mut reader = open(&write_capture(&folder.path().join("a.pcap"), &packets));
    assert_eq!(reader.model(), Model::Hdl32e);
    let sweeps = sweeps(&mut reader);
    assert_eq!(sweeps.len(), 4);
    // The clock wraps at the full hour, which is 1.5 s in and not reached here. The time of a shot follows from its number.
    let mut shots = packets.iter().enumerate().flat_map(|(number, (_, _, payload))| {
        let payload = payload.clone();
        (0..12 * 32).filter_map(move |shot: usize| {
            let at = shot / 32 * 100 + 4 + shot % 32 * 3;
            let range = u16::from_le_bytes([payload[at], payload[at + 1]]);
            let nanos = number as i64 * 552_960 / 1000 * 1000 + (shot / 32 * 46_080 + shot % 32 * 1152) as i64;
            (range > 0).then_some((f32::from(range) * 0.002, payload[at + 2], shot % 32, nanos))
        })
    });
    let rings = Model::Hdl32e.rings();
    for (info, returns) in &sweeps {
        assert_eq!(info.n_returns, returns.len());
        for found in returns {
            let (range_m, intensity, laser, nanos) = shots.next().expect("as many shots");
            assert_eq!((found.intensity, found.ring), (intensity, rings[laser]));
            assert!(((found.x * found.x + found.y * found.y + found.z * found.z).sqrt() - range_m).abs() < 1e-4);
            let at = info.stamp.0 + i64::from(found.offset_nanos) - BEGIN.0;
            // The sensor's stamps are whole µs, and so are those of its packets.
            assert!((at - nanos).abs() <= 1000, "{at} {nanos}");
            let turned = f64::from(found.azimuth) * 0.01;
            let azimuth = f64::from(-found.y).atan2(f64::from(found.x)).to_degrees().rem_euclid(360.0);
            assert!((azimuth - turned).abs() < 1e-3, "{azimuth} {turned}");
        }
    }
    assert!(shots.next().is_none());
    for (info, _) in &sweeps[..3] {
        assert!((i64::from(info.duration_nanos) - 100_000_000).abs() < 100_000, "{info:?}");
        assert!(info.turn > 0.999);
    }
    let expected = LidarStats { data_packets: N_PACKETS as u64, ..LidarStats::default() };
    assert_eq!(reader.stats(), expected);
}

#[test]
fn time_is_continuous_across_the_full_hour() {
    let folder = tempfile::tempdir().expect("a folder");
    // 1.5 s to the hour is 2713 packets.
    let packets = hdl32e_packets(3000);
    let sweeps = sweeps(&mut open(&write_capture(&folder.path().join("a.pcap"), &packets)));
    assert_eq!(sweeps.len(), 17);
    for (k, (info, _)) in sweeps.iter().enumerate() {
        assert!((info.stamp.0 - BEGIN.0 - k as i64 * 100_000_000).abs() < 100_000, "{k}: {info:?}");
        assert_eq!(info.lost_packets, 0);
    }
}

#[test]
fn lost_duplicated_late_short_and_foreign_packets_are_counted_and_affect_no_other_packet() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = hdl32e_packets(N_PACKETS);
    let reference = sweeps(&mut open(&write_capture(&folder.path().join("whole.pcap"), &whole)));

    let mut torn = whole.clone();
    torn.drain(300..305); // in revolution 1
    torn.swap(420, 421); // late
    let doubled = torn[100].clone();
    torn.insert(101, doubled);
    let mut other_sensor = torn[50].clone();
    other_sensor.2[1205] = 0x22;
    torn.insert(51, other_sensor);
    torn.insert(52, (torn[50].0, 2368, vec![1; 100]));
    torn.insert(53, (torn[50].0, 5353, vec![1; 100]));
    let rmc = "$GPRMC,214106,V,,,,,,,141123,,,N*49";
    torn.insert(54, (torn[50].0, 8308, encode_position_packet(BEGIN, PulseStatus::Locked, rmc).to_vec()));
    torn[200].2[500] = 0; // the flag of a block
    let mut reader = open(&write_capture(&folder.path().join("torn.pcap"), &torn));
    let found = sweeps(&mut reader);

    let expected = LidarStats {
        data_packets: N_PACKETS as u64 - 6,
        position_packets: 1,
        lost_packets: 6,
        duplicated_packets: 1,
        late_packets: 1,
        short_packets: 1,
        foreign_packets: 2,
        bad_blocks: 1,
        ..LidarStats::default()
    };
    assert_eq!(reader.stats(), expected);
    assert!(reader.stats().has_lost_data());
    assert_eq!(found.iter().map(|(info, _)| info.lost_packets).collect::<Vec<_>>(), [0, 5, 1, 0]);
    // Received packets give the same returns as before.
    assert_eq!(found.len(), reference.len());
    for ((info, returns), (whole_info, whole_returns)) in found.iter().zip(&reference) {
        assert_eq!(info.stamp, whole_info.stamp);
        let mut whole = whole_returns.iter();
        assert!(returns.iter().all(|one| whole.any(|other| other == one)));
    }
    assert_eq!(found[0].1, reference[0].1);
    assert_eq!(found[3].1, reference[3].1);
    assert!(found[1].1.len() < reference[1].1.len());
}

#[test]
fn reading_resumed_between_any_two_sweeps_gives_the_same_sweeps() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = hdl32e_packets(N_PACKETS);
    // One recording in two files, cut within a revolution.
    let files = [
        write_capture(&folder.path().join("0.pcap"), &packets[..250]),
        write_capture(&folder.path().join("1.pcap"), &packets[250..]),
    ];
    let mut reader = SweepReader::open(files.to_vec(), None).expect("opens");
    let mut positions = vec![reader.position()];
    let mut whole = Vec::new();
    while let Some(info) = reader.next_sweep(|_| {}).expect("reads") {
        whole.push(info);
        positions.push(reader.position());
    }
    assert_eq!(whole.len(), 4);
    let reference = sweeps(&mut SweepReader::open(files.to_vec(), None).expect("opens"));
    for (k, position) in positions.iter().enumerate() {
        let mut resumed = SweepReader::open(files.to_vec(), Some(Model::Hdl32e)).expect("opens");
        resumed.resume(*position).expect("is there");
        assert_eq!(sweeps(&mut resumed), reference[k..], "from sweep {k}");
        assert_eq!(resumed.stats(), reader.stats());
    }
    // A saved position in files that became shorter.
    write_capture(&files[1], &packets[250..260]);
    let mut resumed = SweepReader::open(files.to_vec(), None).expect("opens");
    assert!(matches!(resumed.resume(positions[3]), Err(SweepError::Position { .. })));
}

#[test]
fn capture_without_sensor_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = write_capture(&folder.path().join("a.pcap"), &[(BEGIN, 2368, vec![0; 1206])]);
    let error = SweepReader::open(vec![path.clone()], Some(Model::Vlp16)).expect_err("nothing there");
    assert!(error.to_string().contains("a.pcap: no data packet of vlp16"), "{error}");
    let hdl = write_capture(&path, &hdl32e_packets(3));
    assert!(SweepReader::open(vec![hdl.clone()], Some(Model::Vlp16)).is_err());
    assert!(SweepReader::open(vec![hdl], Some(Model::Hdl32e)).is_ok());
    std::fs::write(&path, "root:x:0:0").expect("writes");
    let error = SweepReader::open(vec![path], None).expect_err("no capture").to_string();
    assert!(error.contains("a.pcap, byte 0: magic number") && error.contains("neither pcap nor pcapng"), "{error}");
}

#[test]
fn two_echoes_of_one_shot_share_its_time_and_equal_echoes_are_merged() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut packets = hdl32e_packets(2);
    for (number, (_, _, payload)) in packets.iter_mut().enumerate() {
        payload[1204] = 0x39;
        for pair in 0..6 {
            let azimuth = (1000 + (number * 6 + pair) as u16 * 18).to_le_bytes();
            let (first, second) = (pair * 200, pair * 200 + 100);
            payload.copy_within(first..second, second);
            // The last echo of laser 3 is farther than the strongest.
            payload[first + 4 + 9..first + 4 + 12].copy_from_slice(&[0x10, 0x27, 9]);
            payload[second + 4 + 9..second + 4 + 12].copy_from_slice(&[0x88, 0x13, 70]);
            for block in [first, second] {
                payload[block + 2..block + 4].copy_from_slice(&azimuth);
            }
        }
        let micros = 3_598_500_000_u32 + number as u32 * 276;
        payload[1200..1204].copy_from_slice(&micros.to_le_bytes());
    }
    let mut reader = open(&write_capture(&folder.path().join("a.pcap"), &packets));
    let [(_, returns)] = sweeps(&mut reader).try_into().expect("one sweep");
    assert_eq!(reader.stats().lost_packets, 0);
    let ring = Model::Hdl32e.rings()[3];
    let echoes: Vec<_> = returns.iter().filter(|found| found.ring == ring).collect();
    assert_eq!(echoes.len(), 24);
    for pair in echoes.chunks(2) {
        assert_eq!(pair[0].offset_nanos, pair[1].offset_nanos);
        assert_eq!((pair[0].azimuth, pair[0].intensity, pair[1].intensity), (pair[1].azimuth, 9, 70));
        assert!((pair[0].z / pair[1].z - 2.0).abs() < 1e-6);
    }
    // Of the other lasers both echoes are equal.
    assert!(returns.iter().filter(|found| found.ring == 0).count() <= 12);
}
