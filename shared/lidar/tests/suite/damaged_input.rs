//! No reader panics or hangs on damaged bytes.

use crate::support::{self, BEGIN, hdl32e_packets, write_capture};
use damage::attack;
use geometry::Stamp;
use lidar::SweepReader;
use lidar::nmea::{Fix, fixes, gga_from_fix, rmc_from_fix};
use lidar::pcap::PacketReader;
use lidar::velodyne::{DataPacket, Decoder, Model, PositionPacket};
use random::Random;

fn pcapng(packets: &[support::Sent]) -> Vec<u8> {
    let block = |kind: u32, body: &[u8]| {
        let total = (12 + body.len().next_multiple_of(4)) as u32;
        let mut bytes = [kind.to_le_bytes(), total.to_le_bytes()].concat();
        bytes.extend(body);
        bytes.resize(total as usize - 4, 0);
        bytes.extend(total.to_le_bytes());
        bytes
    };
    let mut file = block(0x0a0d_0d0a, &[0x4d, 0x3c, 0x2b, 0x1a, 1, 0, 0, 0, 255, 255, 255, 255, 255, 255, 255, 255]);
    // Interface 0: Ethernet, nanoseconds.
    file.extend(block(1, &[1, 0, 0, 0, 0, 0, 0, 0, 9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0]));
    for (number, packet) in packets.iter().enumerate() {
        let mut classic = Vec::new();
        let mut writer = lidar::pcap::Writer::new(&mut classic).expect("writes");
        writer.write_udp(packet.0, packet.1, &packet.2).expect("writes");
        let frame = &classic[40..];
        let nanos = packet.0.0 as u64;
        let words = [0, (nanos >> 32) as u32, nanos as u32, frame.len() as u32, frame.len() as u32];
        file.extend(block(6, &[words.map(u32::to_le_bytes).concat(), frame.to_vec()].concat()));
        if number % 50 == 0 {
            // Statistics blocks are ignored.
            file.extend(block(5, &[0; 20]));
        }
    }
    file
}

#[test]
fn pcapng_reads_equal_to_pcap() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = hdl32e_packets(400);
    let ng = folder.path().join("a.pcapng");
    std::fs::write(&ng, pcapng(&packets)).expect("writes");
    let mut reader = support::open(&ng);
    let mut classic = support::open(&write_capture(&folder.path().join("a.pcap"), &packets));
    let first = reader.next_sweep(|_| {}).expect("reads").expect("is there");
    assert_eq!(Some(first), classic.next_sweep(|_| {}).expect("reads"));
    let position = reader.position();
    let rest = support::sweeps(&mut classic);
    assert_eq!(support::sweeps(&mut reader), rest);
    let mut resumed = support::open(&ng);
    resumed.resume(&position).expect("is there");
    assert_eq!(support::sweeps(&mut resumed), rest);
}

/// Statistics blocks follow the packets 0 and 50, so a position at packet 1 or 51 has a block of another kind right before it.
#[test]
fn pcapng_resumes_at_every_packet() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.pcapng");
    std::fs::write(&path, pcapng(&hdl32e_packets(60))).expect("writes");
    let mut reader = PacketReader::open(&path).expect("opens");
    let mut offsets = Vec::new();
    while let Some(packet) = reader.next().expect("reads") {
        offsets.push(packet.offset);
    }
    assert_eq!(offsets.len(), 60);
    for offset in offsets {
        let mut reader = PacketReader::open_at(&path, offset).expect("opens");
        assert_eq!(reader.next().expect("reads").map(|packet| packet.offset), Some(offset));
    }
}

#[test]
fn damaged_captures_do_not_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = hdl32e_packets(40);
    let classic = std::fs::read(write_capture(&folder.path().join("a.pcap"), &packets)).expect("reads");
    let path = folder.path().join("b.pcap");
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("writes");
        let Ok(mut reader) = SweepReader::open(vec![path.clone()], Some(&Model::Hdl32e.into())) else { return };
        let mut n_returns = 0;
        while let Ok(Some(info)) = reader.next_sweep(|piece| n_returns += piece.len()) {
            assert!(info.n_returns <= SweepReader::MAX_RETURNS);
        }
        assert!(n_returns <= 42 * 384);
    };
    attack(1, 400, &classic, read);
    attack(2, 400, &pcapng(&packets), read);
}

#[test]
fn damaged_packets_do_not_panic() {
    let packet = hdl32e_packets(1).remove(0).2;
    let decoders = Model::ALL.map(Decoder::new);
    let mut returns = Vec::new();
    let mut random = Random::new(3);
    for _ in 0..20_000 {
        let mut bytes = packet.clone();
        for _ in 0..random.index(20) {
            // Mostly flags and angles.
            let at = if random.index(2) == 0 { random.index(12) * 100 + random.index(4) } else { random.index(1206) };
            bytes[at] = random.bits() as u8;
        }
        let Some(packet) = DataPacket::new(&bytes) else { continue };
        for decoder in &decoders {
            returns.clear();
            decoder.decode_into(packet, 0..12, random.bits() as i64 >> 16, &mut returns);
            let n_rings = decoder.model().n_rings();
            assert!(
                returns
                    .iter()
                    .all(|found| found.x.is_finite() && found.azimuth < 36_000 && usize::from(found.ring) < n_rings)
            );
        }
    }
    attack(4, 2000, &[7; 512], |bytes| assert_eq!(PositionPacket::new(bytes).is_some(), bytes.len() == 512));
}

#[test]
fn damaged_sentences_do_not_panic() {
    let fix = |i: i64| Fix {
        stamp: Stamp(BEGIN.0 + i * 1_000_000_000),
        position_deg: [48.0, 2.0],
        altitude_m: Some(100.0),
        speed_mps: Some(1.0),
        course_deg: Some(2.0),
        hdop: Some(1.0),
        satellites: 9,
        quality: 1,
        vdop: None,
        deviation: None,
    };
    let log: String =
        (0..20).flat_map(|i| [gga_from_fix(&fix(i), 44.0), "\n".into(), rmc_from_fix(&fix(i)), "\n".into()]).collect();
    attack(5, 5000, log.as_bytes(), |bytes| {
        let (found, _) = fixes(bytes);
        assert!(found.len() <= 41 && found.iter().all(|fix| fix.position_deg[0].abs() <= 90.0));
    });
}
