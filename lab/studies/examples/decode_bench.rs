//! Measures points per second of the packet decoders on one core:
//! `cargo run --release -p studies --example decode_bench -- CAPTURE [MODEL [CALIBRATION]]`.
//!
//! `decode` measures the decoder with packets in memory, `file to sweeps` reading from the file to complete sweeps.

use lidar::pcap::PacketReader;
use lidar::{Lidar, Model, PacketDecoder, SweepPoint, SweepReader};
use std::path::PathBuf;
use std::time::Instant;

const ROUNDS: usize = 200;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let path = PathBuf::from(args.next().ok_or("usage: decode_bench CAPTURE [MODEL [CALIBRATION]]")?);
    let lidar = match (args.next(), args.next()) {
        (None, _) => SweepReader::open(vec![path.clone()], None)?.lidar().clone(),
        (Some(name), calibration) => {
            let model = Model::from_name(&name).ok_or_else(|| format!("MODEL must be one of {}", Model::names()))?;
            match calibration {
                Some(file) => Lidar::with_calibration(model, &file, std::fs::read_to_string(&file)?)?,
                None => Lidar::from(model),
            }
        }
    };
    let name = lidar.model().name();
    let mut decoder = PacketDecoder::new(&lidar);
    let mut returns: Vec<SweepPoint> = Vec::with_capacity(1 << 20);
    let mut packets: Vec<Vec<u8>> = Vec::new();
    let mut reader = PacketReader::open(&path)?;
    while let Some(packet) = reader.next()? {
        if decoder.decode_into(packet.payload, &mut returns) {
            packets.push(packet.payload.to_vec());
        }
    }

    let mut n_points = 0;
    let mut best = f64::INFINITY;
    for _ in 0..ROUNDS {
        returns.clear();
        let start = Instant::now();
        for payload in &packets {
            decoder.decode_into(payload, &mut returns);
        }
        best = best.min(start.elapsed().as_secs_f64());
        n_points = returns.len();
    }
    println!("{name} decode: {n_points} points, {:.1} million points/s", n_points as f64 / best * 1e-6);

    let mut best = f64::INFINITY;
    for _ in 0..ROUNDS / 4 {
        returns.clear();
        let mut sweeps = SweepReader::open(vec![path.clone()], Some(&lidar))?;
        let start = Instant::now();
        while sweeps.next_sweep(|piece| returns.extend_from_slice(piece))?.is_some() {}
        best = best.min(start.elapsed().as_secs_f64());
    }
    let rate = returns.len() as f64 / best * 1e-6;
    println!("{name} file to sweeps: {} points, {rate:.1} million points/s", returns.len());
    Ok(())
}
