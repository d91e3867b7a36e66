//! The packets of the sensor, sorted out from all packets of the captures and put in order.

use super::{PacketPosition, SweepError, SweepReader};
use crate::velodyne::PositionPacket;
use crate::velodyne::capture::Arrival;
use crate::velodyne::clock::Step;
use crate::velodyne::packet::{
    BLOCKS_PER_PACKET, DATA_PACKET_BYTES, DATA_PORT, DataPacket, POSITION_PACKET_BYTES, POSITION_PORT,
};
use crate::velodyne::reorder::{Held, Place, n_lost};

impl SweepReader {
    /// The next data packet by the clock of the sensor. Returns the number of packets lost before it. `None` at the end, or if no
    /// packet is written yet.
    pub(super) fn next_packet(&mut self) -> Result<Option<u64>, SweepError> {
        let mut is_end = false;
        while !self.at.ended {
            while let Some((packet, is_reordered)) = self.reorder.take(&self.at.clock, self.packet_nanos(), is_end) {
                self.at.stats.reordered_packets += u64::from(is_reordered);
                if let Some(n_lost) = self.accept(&packet) {
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
        let place = Place { file: arrival.file, offset: arrival.offset };
        self.at.read = Some(place);
        let (payload, stats) = (self.captures.payload(), &mut self.at.stats);
        // The sensor sends position packets from another port.
        if arrival.source.ip() != self.sensor.ip() {
            stats.foreign_packets += 1;
            return;
        }
        let own_port = arrival.port == self.port || arrival.port == DATA_PORT || arrival.port == POSITION_PORT;
        if own_port && (arrival.is_cut || payload.len() < POSITION_PACKET_BYTES) {
            stats.short_packets += 1;
            return;
        }
        if let Some(packet) = PositionPacket::new(payload) {
            stats.position_packets += 1;
            self.fixes.extend(self.at.receiver.take(packet.nmea));
            return;
        }
        let packet = DataPacket::new(payload).filter(|packet| self.decoder.model().may_have_sent(*packet));
        let is_of_sensor = arrival.port == self.port && arrival.source == self.sensor;
        match packet.filter(|_| is_of_sensor) {
            Some(packet) => {
                self.reorder.push(Held { place, captured: arrival.captured, bytes: *packet.bytes() });
            }
            None if own_port && payload.len() < DATA_PACKET_BYTES => stats.short_packets += 1,
            None => stats.foreign_packets += 1,
        }
    }

    /// Time from one packet to the next.
    fn packet_nanos(&self) -> i64 {
        i64::from(self.decoder.n_slots(self.slots)) * i64::from(self.decoder.model().timing().block_nanos)
    }

    /// Makes a data packet the current packet, or counts why it is skipped. Returns the number of packets lost before it.
    fn accept(&mut self, held: &Held) -> Option<u64> {
        let packet = DataPacket::new(&held.bytes)?;
        let packet_nanos = self.packet_nanos();
        let stats = &mut self.at.stats;
        if self.at.packet.is_some() && held.bytes == self.bytes {
            stats.duplicated_packets += 1;
            return None;
        }
        let mut lost = 0;
        let stamp = match self.at.clock.step(packet.micros(), held.captured) {
            Step::Late => {
                stats.late_packets += 1;
                return None;
            }
            Step::Repeated { stamp } => stamp,
            Step::Forward { stamp, nanos } => {
                lost = n_lost(&self.at.clock, nanos, packet_nanos) as u64;
                stamp
            }
            Step::Jump { stamp } => {
                stats.clock_jumps += 1;
                stamp
            }
        };
        stats.data_packets += 1;
        stats.lost_packets += lost;
        stats.bad_blocks += (0..BLOCKS_PER_PACKET).filter(|index| packet.azimuth(*index).is_none()).count() as u64;
        self.slots = self.decoder.slots(packet);
        self.bytes = held.bytes;
        self.at.packet = Some(PacketPosition { place: held.place, stamp, block: 0 });
        Some(lost)
    }
}
