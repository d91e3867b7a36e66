//! Position packets: data of the GNSS receiver at the sensor.

use super::packet::{POSITION_MICROS_AT, POSITION_NMEA_AT, POSITION_PACKET_BYTES, POSITION_PULSE_AT};

/// Payload of a position packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PositionPacket<'a> {
    /// µs past the hour by the clock of the sensor.
    pub micros: u32,
    /// State of the pulse per second: a [`super::PulseStatus`], or another value from old firmware.
    pub pulse: u8,
    /// Last sentence of the receiver without line end; empty without receiver.
    pub nmea: &'a str,
}

impl<'a> PositionPacket<'a> {
    /// Parses a payload. `None` unless it has the size of a position packet.
    pub fn new(payload: &'a [u8]) -> Option<Self> {
        let bytes: &[u8; POSITION_PACKET_BYTES] = payload.try_into().ok()?;
        let micros = u32::from_le_bytes(*bytes[POSITION_MICROS_AT..].first_chunk()?);
        let text = &bytes[POSITION_NMEA_AT..];
        let end = text.iter().position(|byte| !(b' '..=b'~').contains(byte)).unwrap_or(text.len());
        // Printable ASCII is UTF-8.
        let nmea = std::str::from_utf8(&text[..end]).unwrap_or_default();
        Some(Self { micros, pulse: bytes[POSITION_PULSE_AT], nmea })
    }
}
