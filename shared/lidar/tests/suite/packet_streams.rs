//! Packet streams as networks deliver them: complete, lossy, duplicated, mixed with other traffic.

use crate::support::{BEGIN, SENSOR, Sent, hdl32e_packets, open, sweeps, write_capture, write_capture_from};
use lidar::pcap::Writer;
use lidar::velodyne::{Model, PulseStatus, RawBlock, RawReturn, encode_data_packet, encode_position_packet};
use lidar::{LidarStats, SweepError, SweepInfo, SweepPoint, SweepReader};
use random::Random;
use std::net::{Ipv4Addr, SocketAddrV4};

/// Three whole revolutions and a bit: 180.84 packets each.
const N_PACKETS: usize = 560;

#[test]
fn encoded_packets_decode_to_points_with_their_times() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = hdl32e_packets(N_PACKETS);
    let mut reader = open(&write_capture(&folder.path().join("a.pcap"), &packets));
    assert_eq!(reader.model(), Model::Hdl32e.into());
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
            // The stamps of the sensor and of its packets are whole µs.
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
    let late = torn.remove(420);
    torn.insert(429, late); // behind nine later packets
    torn.swap(120, 128); // in order again after reading
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
        clock_locked: 1,
        lost_packets: 6,
        duplicated_packets: 1,
        reordered_packets: 8,
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
        let mut resumed = SweepReader::open(files.to_vec(), Some(&Model::Hdl32e.into())).expect("opens");
        resumed.resume(position).expect("is there");
        assert_eq!(sweeps(&mut resumed), reference[k..], "from sweep {k}");
        assert_eq!(resumed.stats(), reader.stats());
    }
    // A saved position in files that became shorter.
    write_capture(&files[1], &packets[250..260]);
    let mut resumed = SweepReader::open(files.to_vec(), None).expect("opens");
    assert!(matches!(resumed.resume(&positions[3]), Err(SweepError::Position { .. })));
}

#[test]
fn capture_without_sensor_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = write_capture(&folder.path().join("a.pcap"), &[(BEGIN, 2368, vec![0; 1206])]);
    let error = SweepReader::open(vec![path.clone()], Some(&Model::Vlp16.into())).expect_err("nothing there");
    assert!(error.to_string().contains("a.pcap: no data packet of vlp16"), "{error}");
    let hdl = write_capture(&path, &hdl32e_packets(3));
    assert!(SweepReader::open(vec![hdl.clone()], Some(&Model::Vlp16.into())).is_err());
    assert!(SweepReader::open(vec![hdl], Some(&Model::Hdl32e.into())).is_ok());
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
            let first = pair * 200;
            let second = pair * 200 + 100;
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

/// Sweeps as reading them resumed before each gives them.
fn resumed_sweeps(path: &std::path::Path) -> Vec<(SweepInfo, Vec<SweepPoint>)> {
    let mut found = Vec::new();
    let mut position = None;
    loop {
        let mut reader = open(path);
        if let Some(position) = position {
            reader.resume(&position).expect("is there");
        }
        let mut returns = Vec::new();
        match reader.next_sweep(|piece| returns.extend_from_slice(piece)).expect("reads") {
            Some(info) => found.push((info, returns)),
            None => return found,
        }
        position = Some(reader.position());
    }
}

#[test]
fn reordered_packets_give_the_sweeps_of_the_sensor() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = hdl32e_packets(N_PACKETS);
    let reference = sweeps(&mut open(&write_capture(&folder.path().join("whole.pcap"), &whole)));
    let mut random = Random::new(11);
    let mut mixed = whole.clone();
    for block in mixed.chunks_mut(9) {
        // The capture stamps packets as they arrive.
        let captured: Vec<_> = block.iter().map(|packet| packet.0).collect();
        for last in (1..block.len()).rev() {
            block.swap(last, random.index(last + 1));
        }
        block.iter_mut().zip(captured).for_each(|(packet, captured)| packet.0 = captured);
    }
    // The first packet determines the start; packets before it would be late.
    let first = mixed.iter().position(|packet| packet.2 == whole[0].2).expect("is there");
    mixed[..=first].rotate_right(1);
    let path = write_capture(&folder.path().join("mixed.pcap"), &mixed);
    let mut reader = open(&path);
    let found = sweeps(&mut reader);
    let stats = reader.stats();
    assert!(stats.reordered_packets > 200, "{stats:?}");
    assert_eq!((stats.data_packets, stats.late_packets, stats.lost_packets), (N_PACKETS as u64, 0, 0));
    assert!(found == reference, "the sweeps differ");
    assert!(resumed_sweeps(&path) == reference, "the resumed sweeps differ");
}

#[test]
fn lossy_recording_resumed_before_any_sweep_gives_the_same_sweeps() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut random = Random::new(12);
    let mut lossy = hdl32e_packets(N_PACKETS);
    // Packets around the ends of the sweeps are also moved.
    lossy.retain(|_| random.index(6) > 0);
    for at in 0..lossy.len() - 3 {
        if random.index(5) == 0 {
            lossy.swap(at, at + 3);
        }
    }
    let path = write_capture(&folder.path().join("lossy.pcap"), &lossy);
    assert!(resumed_sweeps(&path) == sweeps(&mut open(&path)), "the resumed sweeps differ");
}

/// Frames of a packet that was sent in three fragments.
fn fragments(number: u16, sender: SocketAddrV4, (stamp, port, payload): &Sent) -> Vec<(Vec<u8>, Vec<u8>)> {
    let mut record = Vec::new();
    let mut writer = Writer::new(&mut record).expect("writes");
    let target = SocketAddrV4::new(Ipv4Addr::BROADCAST, *port);
    writer.write_datagram(*stamp, sender, target, payload).expect("writes");
    let time = record[24..32].to_vec();
    let frame = &record[40..];
    let (head, datagram) = frame.split_at(34);
    let one = |(index, part): (usize, &[u8])| {
        let mut frame = [head, part].concat();
        frame[16..18].copy_from_slice(&(20 + part.len() as u16).to_be_bytes());
        frame[18..20].copy_from_slice(&number.to_be_bytes());
        let more = if 480 * (index + 1) < datagram.len() { 0x2000 } else { 0 };
        frame[20..22].copy_from_slice(&(more | (60 * index as u16)).to_be_bytes());
        (time.clone(), frame)
    };
    datagram.chunks(480).enumerate().map(one).collect()
}

#[test]
fn packets_in_fragments_give_the_same_sweeps_also_when_resumed() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = hdl32e_packets(N_PACKETS);
    let whole = write_capture(&folder.path().join("whole.pcap"), &packets);
    let reference = sweeps(&mut open(&whole));
    let other: SocketAddrV4 = "192.168.1.77:2368".parse().expect("an address");
    let mut bytes = std::fs::read(&whole).expect("reads")[..24].to_vec();
    let mut random = Random::new(4);
    for (number, two) in packets.chunks(2).enumerate() {
        // Fragments of two packets, and of a packet of another sender of which one fragment is lost, in any order.
        let number = number as u16 * 3;
        let foreign = fragments(number + 2, other, &two[0]).into_iter().skip(usize::from(number.is_multiple_of(2)));
        let own = two.iter().zip(number..).flat_map(|(packet, number)| fragments(number, SENSOR, packet));
        let mut frames: Vec<_> = own.chain(foreign).collect();
        // The first packet determines the start; packets before it would be late.
        for last in (1..frames.len()).rev().filter(|_| number > 0) {
            frames.swap(last, random.index(last + 1));
        }
        for (time, frame) in frames {
            bytes.extend(time);
            bytes.extend([frame.len() as u32; 2].iter().flat_map(|length| length.to_le_bytes()));
            bytes.extend(frame);
        }
    }
    let path = folder.path().join("fragments.pcap");
    std::fs::write(&path, bytes).expect("writes");
    let mut reader = open(&path);
    let found = sweeps(&mut reader);
    let stats = reader.stats();
    assert_eq!((stats.data_packets, stats.late_packets, stats.lost_packets), (N_PACKETS as u64, 0, 0));
    assert!(stats.foreign_packets > 300, "{stats:?}");
    assert!(found == reference, "the sweeps differ");
    assert!(resumed_sweeps(&path) == reference, "the resumed sweeps differ");
}

#[test]
fn stray_packets_before_the_sensor_do_not_decide() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = hdl32e_packets(N_PACKETS);
    let reference = sweeps(&mut open(&write_capture(&folder.path().join("a.pcap"), &packets)));
    let mut stray = packets[0].2.clone();
    stray[1205] = 0x22;
    let other: SocketAddrV4 = "192.168.1.77:2368".parse().expect("an address");
    for sender in [SENSOR, other] {
        let mut sent = vec![(sender, (BEGIN, 2368, stray.clone())), (sender, (BEGIN, 9999, packets[9].2.clone()))];
        sent.extend(packets.iter().map(|packet| (SENSOR, packet.clone())));
        let path = write_capture_from(&folder.path().join("b.pcap"), &sent);
        let mut reader = open(&path);
        assert_eq!(reader.model(), Model::Hdl32e.into());
        assert!(sweeps(&mut reader) == reference, "the sweeps differ");
        assert_eq!(reader.stats().foreign_packets, 2);
        // Also when the manifest names the model.
        let mut reader = SweepReader::open(vec![path], Some(&Model::Hdl32e.into())).expect("opens");
        assert!(sweeps(&mut reader) == reference, "the sweeps differ");
    }
}

#[test]
fn sector_that_is_set_to_fire_nothing_is_not_lost() {
    let folder = tempfile::tempdir().expect("a folder");
    // At 10 Hz, a packet turns by 2 degrees. Nothing is fired from 90 to 200 degrees, then from 300 to 60 degrees.
    for silent in [90.0..200.0, 300.0..420.0_f64] {
        let is_fired = |packet: &usize| {
            let at = (*packet as f64 * 552_960e-9 * 10.0).fract() * 360.0;
            !silent.contains(&at) && !silent.contains(&(at + 360.0))
        };
        let all = hdl32e_packets(3600);
        // Lost packets: single ones elsewhere, and all of half a revolution.
        let is_lost =
            |packet: &usize| [1500, 2210].contains(packet) && is_fired(packet) || (2500..2590).contains(packet);
        let n_lost = (0..all.len()).filter(|packet| is_fired(packet) && is_lost(packet)).count() as i64;
        let kept = |lossy: bool| -> Vec<Sent> {
            let kept = (0..all.len()).filter(|packet| is_fired(packet) && !(lossy && is_lost(packet)));
            kept.map(|packet| all[packet].clone()).collect()
        };
        let stats = |lossy: bool| {
            let path = write_capture(&folder.path().join("a.pcap"), &kept(lossy));
            let mut reader = SweepReader::open(vec![path], None).expect("opens");
            while reader.next_sweep(|_| {}).expect("reads").is_some() {}
            reader.stats()
        };
        assert_eq!(stats(false).lost_packets, 0, "{silent:?}");
        let found = stats(true).lost_packets as i64;
        assert!((found - n_lost).abs() <= 6, "{silent:?}: {found} of {n_lost}");
    }
}

/// The sensor fills a packet that it began before the sector with blocks after it.
#[test]
fn blocks_after_a_silent_sector_have_the_times_of_their_encoder_angles() {
    let folder = tempfile::tempdir().expect("a folder");
    let turned = |nanos: f64| (nanos * 1e-9 * 10.0).fract() * 36_000.0;
    for silent in [9_000.0..20_050.0, 30_000.0..35_990.0_f64] {
        let rounds: Vec<u32> =
            (0..60_000).filter(|round| !silent.contains(&turned(f64::from(*round) * 46_080.0))).collect();
        let packet = |rounds: &[u32]| {
            let returns = [RawReturn { range_2mm: 4000, intensity: 9 }; 32];
            let azimuth = |index: usize| turned(f64::from(rounds[index]) * 46_080.0) as u16;
            let blocks = std::array::from_fn(|index| RawBlock { azimuth: azimuth(index), is_lower: false, returns });
            let stamp = BEGIN.plus_nanos(i64::from(rounds[0]) * 46_080);
            (stamp.plus_nanos(300_000), 2368, encode_data_packet(Model::Hdl32e, stamp, &blocks).to_vec())
        };
        let packets: Vec<Sent> = rounds.chunks_exact(12).map(packet).collect();
        let mut reader = open(&write_capture(&folder.path().join("a.pcap"), &packets));
        let mut largest = 0.0_f64;
        for (info, returns) in sweeps(&mut reader) {
            for found in returns {
                let nanos = info.stamp.0 + i64::from(found.offset_nanos) - BEGIN.0;
                let apart = (turned(nanos as f64) - f64::from(found.azimuth)).abs();
                largest = largest.max(apart.min(36_000.0 - apart));
            }
        }
        // A block turns by 17 counts, the sector by up to 11 050.
        assert!(largest < 40.0, "{silent:?}: {largest} counts");
        assert_eq!(reader.stats().lost_packets, 0, "{silent:?}");
    }
}

#[test]
fn packets_of_a_second_sensor_are_foreign() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = hdl32e_packets(N_PACKETS);
    let reference = sweeps(&mut open(&write_capture(&folder.path().join("a.pcap"), &packets)));
    for second in ["192.168.1.202:2368", "192.168.1.201:2369"] {
        let second: SocketAddrV4 = second.parse().expect("an address");
        let mut sent: Vec<_> = packets.iter().map(|packet| (SENSOR, packet.clone())).collect();
        // Its clock is 20 minutes late, and it sends half as many packets, including the very first one.
        for number in (0..N_PACKETS / 2).rev() {
            let mut packet = packets[2 * number].clone();
            let micros = 2_398_500_000_u32 + number as u32 * 1106;
            packet.2[1200..1204].copy_from_slice(&micros.to_le_bytes());
            sent.insert(2 * number, (second, packet));
        }
        let mut reader = open(&write_capture_from(&folder.path().join("b.pcap"), &sent));
        assert!(sweeps(&mut reader) == reference, "the sweeps differ");
        let stats = reader.stats();
        assert_eq!((stats.foreign_packets, stats.clock_jumps), (N_PACKETS as u64 / 2, 0), "{second}");
    }
}

#[test]
fn bytes_behind_the_damage_of_a_capture_are_counted_as_unread() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = write_capture(&folder.path().join("a.pcap"), &hdl32e_packets(N_PACKETS));
    let whole = std::fs::read(&path).expect("reads");
    let record = 16 + 42 + 1206;
    // One flipped bit in the length of packet 140.
    let mut flipped = whole.clone();
    flipped[24 + 140 * record + 11] ^= 0x80;
    std::fs::write(&path, flipped).expect("writes");
    let mut reader = open(&path);
    sweeps(&mut reader);
    let stats = reader.stats();
    assert_eq!((stats.damaged_captures, stats.unread_bytes), (1, (N_PACKETS - 140) as u64 * record as u64));
    std::fs::write(&path, &whole[..24 + 300 * record + 700]).expect("writes");
    let mut reader = open(&path);
    sweeps(&mut reader);
    let stats = reader.stats();
    assert_eq!((stats.cut_captures, stats.data_packets, stats.unread_bytes), (1, 300, 700));
}
