//! Values into packets, for simulated sensors.

use super::Model;
use super::packet::{
    BLOCK_BYTES, BLOCKS_PER_PACKET, DATA_PACKET_BYTES, FACTORY_AT, LASERS_PER_BLOCK, MICROS_AT, POSITION_MICROS_AT,
    POSITION_NMEA_AT, POSITION_PACKET_BYTES, ReturnMode, UPPER_BLOCK,
};
use geometry::Stamp;

/// One return as the sensor sends it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RawReturn {
    /// In units of 2 mm; 0 = nothing came back.
    pub range_2mm: u16,
    /// 0 to 255.
    pub intensity: u8,
}

/// One round of firings: returns in firing order ([`Model::lasers`] has the angles).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RawBlock {
    /// Encoder angle at the first firing, 0.01 deg, 0 to 35999.
    pub azimuth: u16,
    /// By laser.
    pub returns: [RawReturn; LASERS_PER_BLOCK],
}

/// The payload of a data packet whose first laser fires at `stamp` (cut to µs), strongest returns.
/// For sensors with one kind of block: HDL-32E and VLP-16.
pub fn encode_data_packet(
    model: Model,
    stamp: Stamp,
    blocks: &[RawBlock; BLOCKS_PER_PACKET],
) -> [u8; DATA_PACKET_BYTES] {
    let mut bytes = [0; DATA_PACKET_BYTES];
    for (block, out) in blocks.iter().zip(bytes.chunks_exact_mut(BLOCK_BYTES)) {
        out[..2].copy_from_slice(&UPPER_BLOCK.to_le_bytes());
        out[2..4].copy_from_slice(&block.azimuth.to_le_bytes());
        for (return_, out) in block.returns.iter().zip(out[4..].chunks_exact_mut(3)) {
            out[..2].copy_from_slice(&return_.range_2mm.to_le_bytes());
            out[2] = return_.intensity;
        }
    }
    bytes[MICROS_AT..FACTORY_AT].copy_from_slice(&micros_past_hour(stamp).to_le_bytes());
    bytes[FACTORY_AT] = ReturnMode::Strongest as u8;
    bytes[FACTORY_AT + 1] = model.product_byte();
    bytes
}

/// The payload of a position packet sent at `stamp`: `nmea` is one sentence without line end, at most 304 bytes (more is
/// cut; a `$GPRMC` has some 70).
pub fn encode_position_packet(stamp: Stamp, nmea: &str) -> [u8; POSITION_PACKET_BYTES] {
    let mut bytes = [0; POSITION_PACKET_BYTES];
    bytes[POSITION_MICROS_AT..][..4].copy_from_slice(&micros_past_hour(stamp).to_le_bytes());
    let room = &mut bytes[POSITION_NMEA_AT..];
    let length = nmea.len().min(room.len() - 2);
    room[..length].copy_from_slice(&nmea.as_bytes()[..length]);
    room[length..length + 2].copy_from_slice(b"\r\n");
    bytes
}

fn micros_past_hour(stamp: Stamp) -> u32 {
    (stamp.0.rem_euclid(3_600_000_000_000) / 1000) as u32
}
