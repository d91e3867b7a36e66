//! Real packets of three sensors, with the digests of their fields computed by Ouster's SDK.

use super::packet::{Column, Echo};
use super::{Metadata, Profile};
use crate::pcap::PacketReader;
use crate::{Lidar, Model, SweepReader};
use std::path::PathBuf;

fn path(name: &str) -> PathBuf {
    real_data::path(&format!("lidars/ouster/{name}"))
}

fn metadata(name: &str) -> Metadata {
    Metadata::from_json(&std::fs::read_to_string(path(name)).expect("a file")).expect("reads")
}

/// Payloads of the data packets.
fn packets(capture: &str, metadata: &Metadata) -> Vec<Vec<u8>> {
    let mut reader = PacketReader::open(&path(capture)).expect("opens");
    let mut packets = Vec::new();
    while let Some(packet) = reader.next().expect("reads") {
        if metadata.is_data(packet.payload) {
            packets.push(packet.payload.to_vec());
        }
    }
    packets
}

/// MD5 (RFC 1321), hexadecimal.
fn md5(bytes: &[u8]) -> String {
    const SHIFTS: [[u32; 4]; 4] = [[7, 12, 17, 22], [5, 9, 14, 20], [4, 11, 16, 23], [6, 10, 15, 21]];
    let mut message = bytes.to_vec();
    message.push(0x80);
    message.resize((message.len() + 8).next_multiple_of(64) - 8, 0);
    message.extend((bytes.len() as u64 * 8).to_le_bytes());
    let mut state = [0x6745_2301_u32, 0xefcd_ab89, 0x98ba_dcfe, 0x1032_5476];
    for chunk in message.chunks_exact(64) {
        let word = |i: usize| u32::from_le_bytes(chunk[4 * i..4 * i + 4].try_into().expect("four bytes"));
        let [mut a, mut b, mut c, mut d] = state;
        for i in 0..64 {
            let (f, g) = match i / 16 {
                0 => ((b & c) | (!b & d), i),
                1 => ((d & b) | (!d & c), 5 * i + 1),
                2 => (b ^ c ^ d, 3 * i + 5),
                _ => (c ^ (b | !d), 7 * i),
            };
            let k = ((i as f64 + 1.0).sin().abs() * 4_294_967_296.0) as u32;
            let sum = f.wrapping_add(a).wrapping_add(k).wrapping_add(word(g % 16));
            a = d;
            d = c;
            c = b;
            b = b.wrapping_add(sum.rotate_left(SHIFTS[i / 16][i % 4]));
        }
        for (sum, part) in state.iter_mut().zip([a, b, c, d]) {
            *sum = sum.wrapping_add(part);
        }
    }
    let digest = state.map(u32::swap_bytes);
    digest.iter().fold(String::new(), |text, word| text + &format!("{word:08x}"))
}

/// The bytes of a field of all packets, in the layout of the SDK: arrays of beams by columns.
fn field(packets: &[Vec<u8>], metadata: &Metadata, value: impl Fn([Echo; 2]) -> Vec<u8>) -> Vec<u8> {
    let profile = metadata.profile;
    let n_beams = metadata.n_beams();
    let mut bytes = Vec::new();
    for packet in packets {
        for beam in 0..n_beams {
            for column in 0..metadata.n_columns {
                let column = Column::from_payload(packet, profile, n_beams, column).expect("a column");
                bytes.extend(value(profile.echoes(column.pixels().nth(beam).expect("a pixel"))));
            }
        }
    }
    bytes
}

fn check_digest(name: &str, has_two_echoes: bool) {
    assert_eq!(md5(b"message digest"), "f96b697d7cb7938d525a2f31aaf161d0");
    let metadata = metadata(&format!("{name}.json"));
    let packets = packets(&format!("{name}.pcap"), &metadata);
    assert_eq!(packets.len(), 64);
    let digest = std::fs::read_to_string(path(&format!("{name}_digest.json"))).expect("a file");
    let digest: serde_json::Value = serde_json::from_str(&digest).expect("JSON");
    let expected = |field: &str| digest["packet_hash"][field].as_str().expect("a digest").to_owned();
    let range = |echo: Echo| echo.range_mm.to_le_bytes().to_vec();
    let reflectivity = |echo: Echo| vec![echo.reflectivity as u8];
    let mut fields = vec![
        ("RANGE", field(&packets, &metadata, |echoes| range(echoes[0]))),
        ("REFLECTIVITY", field(&packets, &metadata, |echoes| reflectivity(echoes[0]))),
    ];
    if has_two_echoes {
        fields.push(("RANGE2", field(&packets, &metadata, |echoes| range(echoes[1]))));
        fields.push(("REFLECTIVITY2", field(&packets, &metadata, |echoes| reflectivity(echoes[1]))));
    }
    let columns = || {
        let column = |packet, index| {
            Column::from_payload(packet, metadata.profile, metadata.n_beams(), index).expect("a column")
        };
        packets.iter().flat_map(move |packet| (0..16).map(move |index| column(packet, index)))
    };
    fields.push(("TIMESTAMP", columns().flat_map(|column| column.nanos().to_le_bytes()).collect()));
    fields.push(("MEASUREMENT_ID", columns().flat_map(|column| column.number().to_le_bytes()).collect()));
    for (name, bytes) in fields {
        assert_eq!(md5(&bytes), expected(name), "{name}");
    }
    check_points(name, &metadata, &packets);
}

/// Compares the points of the only sweep with the formula of the manual, in double precision.
fn check_points(name: &str, metadata: &Metadata, packets: &[Vec<u8>]) {
    let text = std::fs::read_to_string(path(&format!("{name}.json"))).expect("a file");
    let lidar = Lidar::with_calibration(Model::Ouster, "a.json", text).expect("reads");
    let mut reader = SweepReader::open(vec![path(&format!("{name}.pcap"))], Some(&lidar)).expect("opens");
    let mut returns = Vec::new();
    let info = reader.next_sweep(|some| returns.extend_from_slice(some)).expect("reads").expect("a sweep");
    assert!(reader.next_sweep(|_| {}).expect("reads").is_none());
    let stats = reader.stats();
    assert!(!stats.has_lost_data() && stats.foreign_packets == 0 && stats.position_packets == 10, "{stats:?}");
    assert!((info.turn - 1.0).abs() < 2e-3 && (99_000_000..101_000_000).contains(&info.duration_nanos), "{info:?}");
    let n = f64::from(metadata.columns_per_turn);
    let origin_mm = metadata.origin_m[0] * 1e3;
    let mut found = returns.iter();
    let mut worst = 0.0_f64;
    let up_mm = metadata.sensor_from_lidar.1[2] * 1e3;
    for packet in packets {
        for index in 0..16 {
            let column = Column::from_payload(packet, metadata.profile, metadata.n_beams(), index).expect("a column");
            let encoder = std::f64::consts::TAU * (1.0 - f64::from(column.number()) / n);
            for (beam, pixel) in column.pixels().enumerate() {
                let [first, second] = metadata.profile.echoes(pixel);
                let echoes = [Some(first), Some(second).filter(|second| *second != first)];
                for echo in echoes.into_iter().flatten().filter(|echo| echo.range_mm > 0) {
                    let azimuth = encoder - metadata.azimuths_deg[beam].to_radians();
                    let elevation = metadata.elevations_deg[beam].to_radians();
                    let across = (f64::from(echo.range_mm) - origin_mm) * elevation.cos();
                    let x = across * azimuth.cos() + origin_mm * encoder.cos();
                    let y = across * azimuth.sin() + origin_mm * encoder.sin();
                    let z = (f64::from(echo.range_mm) - origin_mm) * elevation.sin() + up_mm;
                    // The sensor frame is the lidar frame turned by half a turn.
                    let expected = [-x, -y, z].map(|mm| mm * 1e-3);
                    let ours = found.next().expect("as many points");
                    let off = [ours.x, ours.y, ours.z].into_iter().zip(expected).map(|(a, b)| (f64::from(a) - b).abs());
                    worst = off.fold(worst, f64::max);
                    assert_eq!(u16::from(ours.intensity), echo.reflectivity);
                    assert_eq!(i64::from(ours.offset_nanos), column.nanos() as i64 - first_nanos(packets, metadata));
                    assert_eq!(
                        ours.azimuth,
                        ((f64::from(column.number()) / n + 0.5).fract() * 36_000.0).round() as u16 % 36_000
                    );
                }
            }
        }
    }
    assert!(found.next().is_none());
    eprintln!("{name}: {} points, worst {:.4} mm", returns.len(), worst * 1e3);
    assert!(worst < 1e-4, "{worst} m");
    assert_eq!(info.stamp.0 % 1000, 0);
}

fn first_nanos(packets: &[Vec<u8>], metadata: &Metadata) -> i64 {
    Column::from_payload(&packets[0], metadata.profile, metadata.n_beams(), 0).expect("a column").nanos() as i64
}

#[real_data::test("lidars/ouster/OS-0-32-U1_v2.2.0_1024x10.pcap")]
fn os0_32_with_two_echoes_has_the_fields_of_the_sdk() {
    check_digest("OS-0-32-U1_v2.2.0_1024x10", true);
}

#[real_data::test("lidars/ouster/OS-2-128-U1_v2.3.0_1024x10.pcap")]
fn os2_128_has_the_fields_of_the_sdk() {
    check_digest("OS-2-128-U1_v2.3.0_1024x10", false);
}

#[real_data::test("lidars/ouster/OS-1-128_v2.3.0_1024x10_lb_n3.pcap")]
fn os1_128_with_low_data_rate_decodes_to_full_revolutions() {
    let text = std::fs::read_to_string(path("OS-1-128_v2.3.0_1024x10.json")).expect("a file");
    let lidar = Lidar::with_calibration(Model::Ouster, "a.json", text).expect("reads");
    assert_eq!(metadata("OS-1-128_v2.3.0_1024x10.json").profile, Profile::LowData);
    let capture = path("OS-1-128_v2.3.0_1024x10_lb_n3.pcap");
    let mut reader = SweepReader::open(vec![capture.clone()], Some(&lidar)).expect("opens");
    let mut sweeps = Vec::new();
    loop {
        let mut returns = Vec::new();
        let Some(info) = reader.next_sweep(|some| returns.extend_from_slice(some)).expect("reads") else { break };
        sweeps.push((info, returns));
    }
    assert_eq!((sweeps.len(), reader.n_rings(), reader.stats().has_lost_data()), (3, 128, false));
    for (info, returns) in &sweeps {
        assert!((info.turn - 1.0).abs() < 2e-3, "{info:?}");
        assert!(returns.len() > 128 * 1024 / 4, "{}", returns.len());
        assert!(returns.iter().all(|p| p.ring < 128 && p.x.hypot(p.y).hypot(p.z) < 263.0));
    }
    let error = SweepReader::open(vec![capture], None).expect_err("needs its metadata").to_string();
    assert!(error.contains("set lidar.model = \"ouster\" and lidar.calibration to its metadata file"), "{error}");
}

#[real_data::test("lidars/ouster/same_ports_legacy.pcap")]
fn sensors_that_send_to_one_port_in_fragments_are_distinguished_by_their_size() {
    for (number, n_beams, sender) in [(1, 128, "169.254."), (2, 64, "169.254.")] {
        let text = std::fs::read_to_string(path(&format!("same_ports_legacy.{number}.json"))).expect("a file");
        let lidar = Lidar::with_calibration(Model::Ouster, "a.json", text).expect("reads");
        let mut reader = SweepReader::open(vec![path("same_ports_legacy.pcap")], Some(&lidar)).expect("opens");
        let info = reader.next_sweep(|_| {}).expect("reads").expect("a sweep");
        let stats = reader.stats();
        eprintln!("{number}: {info:?} {stats:?} {sender}");
        assert_eq!((reader.n_rings(), stats.data_packets), (n_beams, 1));
    }
}

#[real_data::test("lidars/ouster/OS-1-64_1024x10_fw20.pcap")]
fn os1_64_of_firmware_2_0_decodes_to_a_full_revolution() {
    // Its metadata is not available; the metadata of another OS1-64 has nearly the same angles.
    let text = std::fs::read_to_string(path("same_ports_legacy.2.json")).expect("a file");
    let lidar = Lidar::with_calibration(Model::Ouster, "a.json", text).expect("reads");
    let mut reader = SweepReader::open(vec![path("OS-1-64_1024x10_fw20.pcap")], Some(&lidar)).expect("opens");
    let mut n = 0;
    let info = reader.next_sweep(|some| n += some.len()).expect("reads").expect("a sweep");
    assert_eq!((n, reader.stats().data_packets, reader.stats().has_lost_data()), (info.n_returns, 64, false));
    assert!((info.turn - 1.0).abs() < 2e-3 && n > 64 * 1024 / 4, "{info:?}");
}
