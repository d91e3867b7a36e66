//! Selects the packets of the sensor from all packets of the captures and puts them in order.

use super::{PacketArrival, PacketPosition, SweepError, SweepReader};
use crate::capture::Arrival;
use crate::clock::Step;
use crate::reorder::{Held, Place, n_lost};
use crate::{Blocks, ClockReference};
use std::net::SocketAddrV4;

impl SweepReader {
    /// The next data packet by the clock of the sensor. Returns the number of packets lost before it. `None` at the end, or if no
    /// packet is written yet.
    pub(super) fn next_packet(&mut self) -> Result<Option<u64>, SweepError> {
        let mut is_end = false;
        while !self.at.ended {
            while let Some((packet, is_reordered)) = self.reorder.take(&self.at.clock, self.packet_nanos(), is_end) {
                self.at.stats.reordered_packets += u64::from(is_reordered);
                if let Some(n_lost) = self.accept(packet) {
                    return Ok(Some(n_lost));
                }
            }
            if is_end {
                self.at.ended = true;
                self.fixes.extend(self.at.receiver.finish());
                break;
            }
            match self.captures.next(&mut self.at.stats)? {
                Some(arrival) => self.sort_out(arrival),
                None if self.captures.is_waiting() => break,
                None => is_end = true,
            }
        }
        Ok(None)
    }

    /// Holds a data packet of the sensor, takes the sentence of a position packet, or counts why a packet is skipped.
    fn sort_out(&mut self, arrival: Arrival) {
        let place = Place { file: arrival.file, offset: arrival.offset, begin: arrival.begin };
        self.at.read = Some(place);
        let is_of_other = |(sender, port): &(SocketAddrV4, u16)| {
            // Status packets of the other LiDAR go to other ports.
            (arrival.source, arrival.port) == (*sender, *port)
                || arrival.source.ip() == sender.ip() && sender.ip() != self.sensor.ip()
        };
        if self.others.iter().any(is_of_other) {
            return;
        }
        let payload = self.captures.payload();
        let stats = &mut self.at.stats;
        // The sensor sends other packets from other ports.
        if arrival.source.ip() != self.sensor.ip() {
            stats.foreign_packets += 1;
            return;
        }
        let lidar = self.decoder.lidar();
        let model = lidar.model();
        let own_port = [self.port, model.data_port(), model.auxiliary_port()].contains(&arrival.port);
        if own_port && arrival.is_cut {
            stats.short_packets += 1;
            return;
        }
        let is_data = arrival.port == self.port && lidar.may_have_sent(payload);
        if is_data && !self.at.source.take(arrival.source, arrival.captured, stats) {
            return;
        }
        let is_auxiliary = lidar.unit.is_auxiliary(payload);
        if is_data || is_auxiliary {
            match lidar.clock_reference(payload).map(ClockReference::is_locked) {
                Some(true) => stats.clock_locked += 1,
                Some(false) => stats.clock_unlocked += 1,
                None => {}
            }
        }
        if is_auxiliary {
            stats.position_packets += 1;
            let fix = lidar.unit.sentence(payload).and_then(|sentence| self.at.receiver.take(sentence));
            self.fixes.extend(fix);
            return;
        }
        if is_data {
            let nanos = lidar.packet_nanos(payload);
            let mut bytes = self.spare.pop().unwrap_or_default();
            bytes.clear();
            bytes.extend_from_slice(payload);
            self.reorder.push(Held { place, captured: arrival.captured, nanos, bytes });
        } else if own_port && lidar.unit.is_short(payload) {
            stats.short_packets += 1;
        } else {
            stats.foreign_packets += 1;
        }
    }

    /// Time from the current packet to the next one, ns; 0 if it varies.
    fn packet_nanos(&self) -> i64 {
        if self.decoder.is_regular() { self.blocks.packet_nanos } else { 0 }
    }

    /// Makes a data packet the current packet, or counts why it is skipped. Returns the number of packets lost before it.
    fn accept(&mut self, mut held: Held) -> Option<u64> {
        let packet_nanos = self.packet_nanos();
        let stats = &mut self.at.stats;
        if self.at.packet.is_some() && held.bytes == self.bytes {
            stats.duplicated_packets += 1;
            self.spare.push(held.bytes);
            return None;
        }
        let mut lost = 0;
        let stamp = match self.at.clock.step(held.nanos, held.captured) {
            Step::Late => {
                stats.late_packets += 1;
                self.spare.push(held.bytes);
                return None;
            }
            Step::Repeated { stamp } => stamp,
            Step::Forward { stamp, nanos } => {
                let mut n_missing = n_lost(&self.at.clock, nanos, packet_nanos);
                let turned =
                    |blocks: &Blocks| (0..blocks.len()).find_map(|index| blocks.get(index)).map(|(_, turned)| turned);
                if n_missing > 0
                    && let Some(sector) = self.silent_sector
                    && let Some((from, to)) = turned(&self.blocks).zip(turned(&self.decoder.blocks(&held.bytes)))
                {
                    n_missing = sector.n_lost(n_missing, nanos, packet_nanos, [from, to]);
                }
                lost = n_missing as u64;
                stamp
            }
            Step::Jump { stamp } => {
                stats.clock_jumps += 1;
                stamp
            }
            Step::RecorderJump { stamp, nanos } => {
                stats.clock_jumps += 1;
                stats.recorder_jumps += 1;
                stats.recorder_jump_ms = stats.recorder_jump_ms.max(nanos.unsigned_abs() / 1_000_000);
                stamp
            }
            Step::SetBack { stamp, nanos } => {
                stats.clock_jumps += 1;
                stats.clocks_set_back += 1;
                stats.set_back_ms += nanos.unsigned_abs() / 1_000_000;
                stamp
            }
        };
        let delay = |packet: PacketArrival| packet.captured.0.saturating_sub(packet.stamp.0);
        let arrival = PacketArrival { stamp, captured: held.captured };
        if self.arrival.is_none_or(|least| delay(arrival) < delay(least)) {
            self.arrival = Some(arrival);
        }
        std::mem::swap(&mut self.bytes, &mut held.bytes);
        self.spare.push(held.bytes);
        self.blocks = self.decoder.blocks(&self.bytes);
        stats.data_packets += 1;
        stats.lost_packets += lost;
        stats.bad_blocks += self.blocks.n_bad() as u64;
        self.at.packet = Some(PacketPosition { place: held.place, stamp, block: 0 });
        Some(lost)
    }
}
