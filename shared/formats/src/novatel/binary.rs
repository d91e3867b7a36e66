//! Binary messages: a header of 12 bytes (short) or more, the body, and a CRC.

use super::crc::crc32;
use super::{Message, NovatelDeviation, NovatelPose, READY};

const LONG_SYNC: [u8; 3] = [0xAA, 0x44, 0x12];
const SHORT_SYNC: [u8; 3] = [0xAA, 0x44, 0x13];
const SHORT_HEADER: usize = 12;
const INSPVA: u16 = 507;
const INSPVAS: u16 = 508;
const INSPVAX: u16 = 1465;
const PVA_BYTES: usize = 88;
const PVAX_BYTES: usize = 126;

/// The message at the start of these bytes, and the bytes that it occupies; `None` if no message starts here.
pub(super) fn message(bytes: &[u8]) -> Option<(Message, usize)> {
    let (header_bytes, body_bytes, week_at) = match bytes.get(..3)? {
        sync if sync == LONG_SYNC => (usize::from(*bytes.get(3)?), usize::from(u16_at(bytes, 8)?), 14),
        sync if sync == SHORT_SYNC => (SHORT_HEADER, usize::from(*bytes.get(3)?), 6),
        _ => return None,
    };
    let kind = u16_at(bytes, 4)?;
    if header_bytes < week_at + 6 {
        return None;
    }
    let end = header_bytes + body_bytes;
    let is_ours = [INSPVA, INSPVAS, INSPVAX].contains(&kind);
    let crc = u32_at(bytes, end);
    if crc != Some(crc32(bytes.get(..end).unwrap_or_default())) {
        // The length may be the damaged part: the search continues inside the message.
        return Some((if is_ours { Message::Damaged } else { Message::Other }, 3));
    }
    let body = &bytes[header_bytes..end];
    let time = || Some((u32::from(u16_at(bytes, week_at)?), f64::from(u32_at(bytes, week_at + 2)?) * 1e-3));
    let decoded = match kind {
        INSPVA | INSPVAS if body_bytes == PVA_BYTES => pose(body),
        INSPVAX if body_bytes == PVAX_BYTES => time().and_then(|(week, second)| extended(body, week, second)),
        INSPVA | INSPVAS | INSPVAX => None,
        _ => Some(Message::Other),
    };
    Some((decoded.unwrap_or(Message::Damaged), end + 4))
}

fn pose(body: &[u8]) -> Option<Message> {
    let mut numbers = [0.0; 9];
    for (index, number) in numbers.iter_mut().enumerate() {
        *number = f64_at(body, 12 + index * 8)?;
    }
    let pose = NovatelPose::new(u32_at(body, 0)?, f64_at(body, 4)?, numbers, 0.0)?;
    Some(Message::Pose { pose, is_ready: is_ready(u32_at(body, 84)?) })
}

fn extended(body: &[u8], week: u32, second: f64) -> Option<Message> {
    // Three doubles, the undulation as a float, then six doubles.
    let mut numbers = [0.0; 9];
    for (index, number) in numbers.iter_mut().enumerate() {
        *number = f64_at(body, 8 + index * 8 + if index < 3 { 0 } else { 4 })?;
    }
    let mut sigmas = [0.0; 9];
    for (index, sigma) in sigmas.iter_mut().enumerate() {
        *sigma = f64::from(f32::from_bits(u32_at(body, 84 + index * 4)?));
    }
    let undulation_m = f64::from(f32::from_bits(u32_at(body, 32)?));
    let pose = NovatelPose::new(week, second, numbers, undulation_m)?;
    let deviation = NovatelDeviation::new(week, second, sigmas);
    Some(Message::Extended { pose, deviation, is_ready: is_ready(u32_at(body, 0)?) })
}

fn is_ready(status: u32) -> bool {
    READY.iter().any(|(_, ready)| *ready == status)
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn f64_at(bytes: &[u8], at: usize) -> Option<f64> {
    Some(f64::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}
