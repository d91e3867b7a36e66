//! Measures points per second of the packet decoder on one core: `cargo run --release -p formats --example decode_bench -- CAPTURE`.
//!
//! `decode` measures the decoder with packets in memory, `file to sweeps` reading from the file to complete sweeps.

use formats::pcap::PacketReader;
use formats::velodyne::{DATA_PACKET_BYTES, DataPacket, Decoder, SweepPoint, SweepReader};
use std::path::PathBuf;
use std::time::Instant;

const ROUNDS: usize = 200;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = PathBuf::from(std::env::args().nth(1).ok_or("usage: decode_bench CAPTURE")?);
    let model = SweepReader::open(vec![path.clone()], None)?.model();
    let mut packets: Vec<[u8; DATA_PACKET_BYTES]> = Vec::new();
    let mut reader = PacketReader::open(&path)?;
    while let Some(packet) = reader.next()? {
        packets.extend(DataPacket::new(packet.payload).map(|packet| *packet.bytes()));
    }
    let decoder = Decoder::new(model);
    let mut returns: Vec<SweepPoint> = Vec::with_capacity(1 << 20);

    let (mut n_points, mut best) = (0, f64::INFINITY);
    for _ in 0..ROUNDS {
        returns.clear();
        let start = Instant::now();
        for packet in packets.iter().filter_map(|bytes| DataPacket::new(bytes)) {
            decoder.decode_into(packet, 0..12, 0, &mut returns);
        }
        best = best.min(start.elapsed().as_secs_f64());
        n_points = returns.len();
    }
    println!("{} decode: {n_points} points, {:.1} million points/s", model.name(), n_points as f64 / best * 1e-6);

    let mut best = f64::INFINITY;
    for _ in 0..ROUNDS / 4 {
        returns.clear();
        let mut sweeps = SweepReader::open(vec![path.clone()], Some(model))?;
        let start = Instant::now();
        while sweeps.next_sweep(|piece| returns.extend_from_slice(piece))?.is_some() {}
        best = best.min(start.elapsed().as_secs_f64());
    }
    let rate = returns.len() as f64 / best * 1e-6;
    println!("{} file to sweeps: {} points, {rate:.1} million points/s", model.name(), returns.len());
    Ok(())
}
