//! Lidar capture with data and position packets, and the labels of the returns.

use super::files::Folder;
use super::manifest::lidar_folder;
use crate::error::SimulationError;
use crate::rig::OtherLidarSpec;
use crate::sensors::gnss::Epoch;
use crate::simulation::Simulation;
use crate::spec::DriveReport;
use crate::truth::Revolutions;
use lidar::pcap;
use lidar::velodyne::{DATA_PORT, POSITION_PORT, PulseStatus, encode_position_packet};
use std::fs::File;
use std::io::BufWriter;

/// Packets per parallel batch: a tenth of a second, so that memory stays small and all threads are busy.
const BATCH: u64 = 181;
/// Data packets for each position packet, as in a real capture of an HDL-32E.
const POSITION_EVERY: u64 = 9;
/// Delay of a position packet after the data packet that triggers it, ns.
const POSITION_DELAY_NANOS: i64 = 100_000;

/// Writes capture and labels. Position packets carry the sentences of the receiver. `done` receives the number of new
/// packets.
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
    let model = *lidar.model();
    let n_packets = model.n_packets(simulation.spec.seconds);
    let mut sentence = String::new();
    for first in (0..n_packets).step_by(BATCH as usize) {
        let last = (first + BATCH).min(n_packets);
        for (packet, blocks) in (first..last).zip(&lidar.packets(first..last)) {
            let stamp = lidar.packet_stamp(packet);
            while let Some(epoch) = epochs.next_if(|epoch| epoch.stamp <= stamp) {
                sentence = epoch.rmc();
            }
            let payload = lidar.payload(packet, blocks);
            capture.write_udp(stamp, DATA_PORT, &payload).map_err(SimulationError::write(&path))?;
            // The device repeats the last sentence of the receiver.
            if packet % POSITION_EVERY == 0 {
                let stamp = stamp.plus_nanos(POSITION_DELAY_NANOS);
                // Without a receiver there is no pulse.
                let pulse = if sentence.is_empty() { PulseStatus::Absent } else { PulseStatus::Locked };
                let payload = encode_position_packet(stamp, pulse, &sentence);
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

/// Writes the captures of the LiDARs after the first. They have no labels.
pub fn write_others(
    simulation: &Simulation,
    folder: &Folder,
    report: &mut DriveReport,
    done: &mut dyn FnMut(u64),
) -> Result<(), SimulationError> {
    for (index, OtherLidarSpec { name, lidar: spec }) in simulation.rig.other_lidars.iter().enumerate() {
        let path = folder.path(&format!("{}/000000.pcap", lidar_folder(name)))?;
        let file = File::create(&path).map_err(SimulationError::write(&path))?;
        let mut capture = pcap::Writer::new(BufWriter::new(file)).map_err(SimulationError::write(&path))?;
        let lidar = simulation.other_lidar(index, spec);
        let n_packets = lidar.model().n_packets(simulation.spec.seconds);
        for first in (0..n_packets).step_by(BATCH as usize) {
            let last = (first + BATCH).min(n_packets);
            for (packet, blocks) in (first..last).zip(&lidar.packets(first..last)) {
                let payload = lidar.payload(packet, blocks);
                let stamp = lidar.packet_stamp(packet);
                capture.write_udp(stamp, DATA_PORT, &payload).map_err(SimulationError::write(&path))?;
                for found in blocks.iter().flat_map(|block| block.returns.iter().flatten()) {
                    report.n_returns += 1;
                    report.returns_by_class[found.class as usize] += 1;
                }
            }
            report.n_packets += last - first;
            done(last - first);
        }
        capture.finish().map_err(SimulationError::write(&path))?;
    }
    Ok(())
}

fn write_labels(folder: &Folder, report: &mut DriveReport, labels: &[u32]) -> Result<(), SimulationError> {
    let bytes: Vec<u8> = labels.iter().flat_map(|label| label.to_le_bytes()).collect();
    folder.write(&format!("truth/labels/{:06}.label", report.n_sweeps), &bytes)?;
    report.n_sweeps += 1;
    Ok(())
}
