//! Captures for the tests.

pub mod bag;

use geometry::Stamp;
use lidar::pcap::Writer;
use lidar::velodyne::{DATA_PORT, Model, RawBlock, RawReturn, encode_data_packet};
use lidar::{SweepInfo, SweepPoint, SweepReader};
use random::Random;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::{Path, PathBuf};

/// 2023-11-14, 1.5 s before a full hour.
pub const BEGIN: Stamp = Stamp(1_699_999_200_000_000_000 - 1_500_000_000);

/// Capture time, UDP port and payload of a packet.
pub type Sent = (Stamp, u16, Vec<u8>);

/// Packets of an HDL-32E at 10 Hz, captured 300 µs after their first shot.
pub fn hdl32e_packets(n: usize) -> Vec<Sent> {
    let mut random = Random::new(7);
    let mut packet = |number: usize| {
        let blocks = std::array::from_fn(|index| {
            let round = (number * 12 + index) as f64;
            let azimuth = ((round * 46_080e-9 * 10.0).fract() * 36_000.0) as u16;
            let mut one = || match random.index(8) {
                0 => RawReturn::default(),
                n => RawReturn { range_2mm: 1000 + 2000 * n as u16, intensity: random.index(256) as u8 },
            };
            RawBlock { azimuth, is_lower: false, returns: std::array::from_fn(|_| one()) }
        });
        let stamp = BEGIN.plus_nanos(number as i64 * 552_960);
        (stamp.plus_nanos(300_000), DATA_PORT, encode_data_packet(Model::Hdl32e, stamp, &blocks).to_vec())
    };
    (0..n).map(&mut packet).collect()
}

/// The address from which [`write_capture`] sends data packets.
pub const SENSOR: SocketAddrV4 = SocketAddrV4::new(Ipv4Addr::new(192, 168, 1, 201), DATA_PORT);

/// A capture in which every packet comes from the port it goes to.
pub fn write_capture(path: &Path, packets: &[Sent]) -> PathBuf {
    let from = |packet: &Sent| (SocketAddrV4::new(*SENSOR.ip(), packet.1), packet.clone());
    write_capture_from(path, &packets.iter().map(from).collect::<Vec<_>>())
}

/// A capture of packets with their senders.
pub fn write_capture_from(path: &Path, packets: &[(SocketAddrV4, Sent)]) -> PathBuf {
    let mut writer = Writer::new(Vec::new()).expect("writes");
    for (sender, (stamp, port, payload)) in packets {
        let target = SocketAddrV4::new(Ipv4Addr::BROADCAST, *port);
        writer.write_datagram(*stamp, *sender, target, payload).expect("writes");
    }
    std::fs::write(path, writer.finish().expect("writes")).expect("writes");
    path.to_owned()
}

/// All remaining sweeps of a reader.
pub fn sweeps(reader: &mut SweepReader) -> Vec<(SweepInfo, Vec<SweepPoint>)> {
    let mut sweeps = Vec::new();
    loop {
        let mut returns = Vec::new();
        match reader.next_sweep(|piece| returns.extend_from_slice(piece)).expect("reads") {
            Some(info) => sweeps.push((info, returns)),
            None => return sweeps,
        }
    }
}

pub fn open(path: &Path) -> SweepReader {
    SweepReader::open(vec![path.to_owned()], None).expect("opens")
}
