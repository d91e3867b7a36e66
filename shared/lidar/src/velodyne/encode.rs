//! Encoding of packets, for simulated sensors.

use super::Model;
use super::packet::{
    BLOCK_BYTES, BLOCKS_PER_PACKET, DATA_PACKET_BYTES, FACTORY_AT, LASERS_PER_BLOCK, LOWER_BLOCK, MICROS_AT,
    POSITION_MICROS_AT, POSITION_NMEA_AT, POSITION_PACKET_BYTES, POSITION_PULSE_AT, ReturnMode, UPPER_BLOCK,
};
use super::position::PositionPacket;
use crate::nmea;
use geometry::Stamp;

/// Microseconds per hour.
const HOUR_MICROS: i64 = 3_600_000_000;

/// One return as the sensor sends it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RawReturn {
    /// Range in units of 2 mm; 0 = no return. A VLP-32C sends it in units of 4 mm, rounded up.
    pub range_2mm: u16,
    /// Intensity, 0 to 255.
    pub intensity: u8,
}

/// One block of firings, returns in firing order ([`Model::lasers`] has the angles).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RawBlock {
    /// Encoder angle at the first firing, 0.01 deg, 0 to 35999.
    pub azimuth: u16,
    /// Whether it contains lasers 32 to 63 (HDL-64E).
    pub is_lower: bool,
    /// Returns by laser.
    pub returns: [RawReturn; LASERS_PER_BLOCK],
}

/// State of the pulse per second (byte 202 of a position packet).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum PulseStatus {
    /// No pulse.
    #[default]
    Absent = 0,
    /// The clock is being synchronized.
    Synchronizing = 1,
    /// The clock is synchronized.
    Locked = 2,
    /// The sensor reports an error of the pulse.
    Error = 3,
}

/// Payload of a data packet with strongest returns, whose first laser fires at `stamp` (truncated to µs). The last two bytes of an
/// HDL-64E are 0; real sensors send a status there.
pub fn encode_data_packet(
    model: Model,
    stamp: Stamp,
    blocks: &[RawBlock; BLOCKS_PER_PACKET],
) -> [u8; DATA_PACKET_BYTES] {
    let mut bytes = [0; DATA_PACKET_BYTES];
    for (block, out) in blocks.iter().zip(bytes.chunks_exact_mut(BLOCK_BYTES)) {
        let flag = if block.is_lower { LOWER_BLOCK } else { UPPER_BLOCK };
        out[..2].copy_from_slice(&flag.to_le_bytes());
        out[2..4].copy_from_slice(&block.azimuth.to_le_bytes());
        for (return_, out) in block.returns.iter().zip(out[4..].chunks_exact_mut(3)) {
            let range = if model == Model::Vlp32c { return_.range_2mm.div_ceil(2) } else { return_.range_2mm };
            out[..2].copy_from_slice(&range.to_le_bytes());
            out[2] = return_.intensity;
        }
    }
    bytes[MICROS_AT..FACTORY_AT].copy_from_slice(&micros_past_hour(stamp).to_le_bytes());
    if model != Model::Hdl64e {
        bytes[FACTORY_AT] = ReturnMode::Strongest as u8;
    }
    bytes[FACTORY_AT + 1] = model.product_byte();
    bytes
}

/// Payload of a position packet sent at `stamp`. `nmea` is one sentence without line end, truncated to 304 bytes (a `$GPRMC` has about
/// 70).
pub fn encode_position_packet(stamp: Stamp, pulse: PulseStatus, nmea: &str) -> [u8; POSITION_PACKET_BYTES] {
    let mut bytes = [0; POSITION_PACKET_BYTES];
    bytes[POSITION_MICROS_AT..][..4].copy_from_slice(&micros_past_hour(stamp).to_le_bytes());
    bytes[POSITION_PULSE_AT] = pulse as u8;
    let room = &mut bytes[POSITION_NMEA_AT..];
    let length = nmea.len().min(room.len() - 2);
    room[..length].copy_from_slice(&nmea.as_bytes()[..length]);
    room[length..length + 2].copy_from_slice(b"\r\n");
    bytes
}

/// Moves the time in a data or position packet by `nanos`, to microseconds, and the sentence of a position packet with it. Other
/// payloads are unchanged.
pub fn restamp(payload: &mut [u8], nanos: i64) {
    let is_position = payload.len() == POSITION_PACKET_BYTES;
    let at = match payload.len() {
        DATA_PACKET_BYTES => MICROS_AT,
        POSITION_PACKET_BYTES => POSITION_MICROS_AT,
        _ => return,
    };
    if let Some(field) = payload.get_mut(at..at + 4) {
        let micros = i64::from(u32::from_le_bytes([field[0], field[1], field[2], field[3]]));
        // The clock of the sensor was never set: keep its invalid time.
        if micros < HOUR_MICROS {
            field.copy_from_slice(&((micros + nanos / 1000).rem_euclid(HOUR_MICROS) as u32).to_le_bytes());
        }
    }
    let Some(sentence) = PositionPacket::new(payload).filter(|_| is_position).map(|packet| packet.nmea.to_owned())
    else {
        return;
    };
    let moved = nmea::restamped(&sentence, nanos);
    let room = &mut payload[POSITION_NMEA_AT..];
    if moved != sentence && moved.len() + 2 <= room.len() {
        room[..moved.len()].copy_from_slice(moved.as_bytes());
        room[moved.len()..].fill(0);
        room[moved.len()..moved.len() + 2].copy_from_slice(b"\r\n");
    }
}

fn micros_past_hour(stamp: Stamp) -> u32 {
    (stamp.0 / 1000).rem_euclid(HOUR_MICROS) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn restamped_packets_are_those_of_the_later_time() {
        let stamp = Stamp(1_600_000_000_123_456_000);
        let nanos = 3_000_000_000_000 + 5_000_000;
        let later = stamp.plus_nanos(nanos);
        let blocks = [RawBlock { azimuth: 7, ..RawBlock::default() }; BLOCKS_PER_PACKET];
        let mut data = encode_data_packet(Model::Hdl32e, stamp, &blocks);
        restamp(&mut data, nanos);
        assert_eq!(data, encode_data_packet(Model::Hdl32e, later, &blocks));
        let sentence = |stamp| nmea::rmc_without_fix(stamp);
        let mut position = encode_position_packet(stamp, PulseStatus::Locked, &sentence(stamp));
        restamp(&mut position, nanos);
        assert_eq!(position[..], encode_position_packet(later, PulseStatus::Locked, &sentence(later))[..]);
        restamp(&mut position, -nanos);
        assert_eq!(position[..], encode_position_packet(stamp, PulseStatus::Locked, &sentence(stamp))[..]);
        let mut unset = data;
        unset[MICROS_AT..FACTORY_AT].fill(0xff);
        let before = unset;
        restamp(&mut unset, nanos);
        assert_eq!(unset, before);
        restamp(&mut [0; 100], nanos);
    }
}
