//! The lidar's packets as a capture, with position packets between them, and the labels of its returns.

use super::files::Folder;
use super::{GNSS_STREAM, Simulation};
use crate::error::SimulationError;
use crate::random::hash;
use crate::sensors::gnss;
use crate::sensors::lidar::{Block, LidarModel, LidarReturn};
use crate::spec::{DriveReport, DriveSpec};
use crate::truth::Revolutions;
use formats::nmea::rmc_from_fix;
use formats::pcap;
use formats::velodyne::{
    DATA_PORT, POSITION_PORT, PulseStatus, RawBlock, RawReturn, encode_data_packet, encode_position_packet,
};
use std::fs::File;
use std::io::BufWriter;

/// Packets that are made at once: a tenth of a second of drive, so that memory stays small and threads stay busy.
const BATCH: u64 = 181;
/// Data packets for each position packet, as in a real capture of an HDL-32E.
const POSITION_EVERY: u64 = 9;
/// A position packet follows the data packet that it waited for, ns.
const POSITION_DELAY_NANOS: i64 = 100_000;

/// What the sensors record, s: to the end of the last lidar packet.
pub fn duration_seconds(spec: &DriveSpec) -> f64 {
    let model = LidarModel::HDL32E;
    (model.n_packets(spec.seconds) as i64 * model.packet_nanos()) as f64 * 1e-9
}

/// Writes capture and labels. `done` hears how many packets were made.
pub fn write(
    simulation: &Simulation,
    folder: &Folder,
    report: &mut DriveReport,
    done: &mut dyn FnMut(u64),
) -> Result<(), SimulationError> {
    let path = folder.path("lidar/000000.pcap")?;
    let file = File::create(&path).map_err(SimulationError::write(&path))?;
    let mut capture = pcap::Writer::new(BufWriter::new(file)).map_err(SimulationError::write(&path))?;
    let lidar = simulation.lidar();
    let seed = hash(simulation.spec.seed, GNSS_STREAM);
    let fixes = gnss::record(&simulation.motion, duration_seconds(&simulation.spec), seed);
    let mut fixes = fixes.iter().peekable();
    let mut revolutions = Revolutions::default();
    let model = *lidar.model();
    let n_packets = model.n_packets(simulation.spec.seconds);
    let mut sentence = String::new();
    for first in (0..n_packets).step_by(BATCH as usize) {
        let last = (first + BATCH).min(n_packets);
        for (packet, blocks) in (first..last).zip(&lidar.packets(first..last)) {
            let stamp = lidar.packet_stamp(packet);
            while let Some(fix) = fixes.next_if(|fix| fix.stamp <= stamp) {
                sentence = rmc_from_fix(fix);
            }
            let payload = encode_data_packet(model.model, stamp, &std::array::from_fn(|i| raw(&blocks[i])));
            capture.write_udp(stamp, DATA_PORT, &payload).map_err(SimulationError::write(&path))?;
            // The device sends the receiver's last sentence again and again.
            if packet % POSITION_EVERY == 0 {
                let stamp = stamp.plus_nanos(POSITION_DELAY_NANOS);
                let payload = encode_position_packet(stamp, PulseStatus::Locked, &sentence);
                capture.write_udp(stamp, POSITION_PORT, &payload).map_err(SimulationError::write(&path))?;
            }
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
        is_lower: block.is_lower,
        returns: block.returns.each_ref().map(|r| r.as_ref().map(raw_return).unwrap_or_default()),
    }
}

fn write_labels(folder: &Folder, report: &mut DriveReport, labels: &[u32]) -> Result<(), SimulationError> {
    let bytes: Vec<u8> = labels.iter().flat_map(|label| label.to_le_bytes()).collect();
    folder.write(&format!("truth/labels/{:06}.label", report.n_sweeps), &bytes)?;
    report.n_sweeps += 1;
    Ok(())
}
