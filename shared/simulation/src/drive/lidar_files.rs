//! The lidar's packets as a capture, with a position packet every second, and the labels of its returns.

use super::Simulation;
use super::files::Folder;
use crate::error::SimulationError;
use crate::sensors::gnss::Epoch;
use crate::sensors::lidar::{BLOCK_NANOS, Block, Lidar, LidarReturn, N_BLOCKS};
use crate::spec::{DriveReport, DriveSpec};
use crate::truth::Revolutions;
use formats::pcap;
use formats::velodyne::{DATA_PORT, POSITION_PORT, RawBlock, RawReturn, encode_data_packet, encode_position_packet};
use rayon::prelude::*;
use std::fs::File;
use std::io::BufWriter;

/// Packets that are made at once: a tenth of a second of drive, so that memory stays small and threads stay busy.
const BATCH: u64 = 181;

/// What the sensors record, s: to the end of the last lidar packet.
pub fn duration_seconds(spec: &DriveSpec) -> f64 {
    (Lidar::n_packets(spec.seconds) as i64 * N_BLOCKS as i64 * BLOCK_NANOS) as f64 * 1e-9
}

/// Writes capture and labels; the receiver's sentences go into position packets. `done` hears how many packets were made.
pub fn write(
    simulation: &Simulation,
    folder: &Folder,
    epochs: &[Epoch],
    report: &mut DriveReport,
    done: &mut dyn FnMut(u64),
) -> Result<(), SimulationError> {
    let path = folder.path("lidar/000000.pcap")?;
    let file = File::create(&path).map_err(SimulationError::write(&path))?;
    let mut capture = pcap::Writer::new(BufWriter::new(file)).map_err(SimulationError::write(&path))?;
    let lidar = simulation.lidar();
    let mut epochs = epochs.iter().peekable();
    let mut revolutions = Revolutions::default();
    let n_packets = Lidar::n_packets(simulation.spec.seconds);
    for first in (0..n_packets).step_by(BATCH as usize) {
        let last = (first + BATCH).min(n_packets);
        let made: Vec<[Block; N_BLOCKS]> = (first..last).into_par_iter().map(|packet| lidar.packet(packet)).collect();
        for (packet, blocks) in (first..last).zip(&made) {
            let stamp = lidar.packet_stamp(packet);
            while let Some(epoch) = epochs.next_if(|epoch| epoch.stamp <= stamp) {
                let payload = encode_position_packet(epoch.stamp, &epoch.rmc());
                capture.write_udp(epoch.stamp, POSITION_PORT, &payload).map_err(SimulationError::write(&path))?;
            }
            let payload =
                encode_data_packet(simulation.rig.lidar.model, stamp, &std::array::from_fn(|i| raw(&blocks[i])));
            capture.write_udp(stamp, DATA_PORT, &payload).map_err(SimulationError::write(&path))?;
            for block in blocks {
                for found in block.returns.iter().flatten() {
                    report.n_returns += 1;
                    report.returns_by_class[found.class as usize] += 1;
                }
                if let Some(labels) = revolutions.push(block) {
                    write_labels(folder, report, &labels)?;
                }
            }
        }
        report.n_packets += last - first;
        done(last - first);
    }
    capture.finish().map_err(SimulationError::write(&path))?;
    let labels = revolutions.finish();
    write_labels(folder, report, &labels)
}

fn raw(block: &Block) -> RawBlock {
    let raw_return = |found: &LidarReturn| RawReturn { range_2mm: found.range_2mm, intensity: found.intensity };
    RawBlock {
        azimuth: block.azimuth,
        returns: block.returns.each_ref().map(|r| r.as_ref().map(raw_return).unwrap_or_default()),
    }
}

fn write_labels(folder: &Folder, report: &mut DriveReport, labels: &[u32]) -> Result<(), SimulationError> {
    let bytes: Vec<u8> = labels.iter().flat_map(|label| label.to_le_bytes()).collect();
    folder.write(&format!("truth/labels/{:06}.label", report.n_sweeps), &bytes)?;
    report.n_sweeps += 1;
    Ok(())
}
