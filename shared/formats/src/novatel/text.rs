//! Messages of text: `#NAME,...,week,seconds,...;fields*crc` and `%NAME,week,seconds;fields*crc`.

use super::crc::crc32;
use super::{Message, NovatelDeviation, NovatelPose, READY};

/// Longest line that is read as a message, bytes.
const MAX_LINE: usize = 2048;

/// The message at the start of these bytes, and the bytes that it occupies; `None` if no message starts here.
pub(super) fn message(bytes: &[u8]) -> Option<(Message, usize)> {
    let line = &bytes[..bytes.len().min(MAX_LINE)];
    let length = line.iter().position(|byte| matches!(byte, b'\r' | b'\n')).unwrap_or(line.len());
    let text = std::str::from_utf8(&line[1..length]).ok()?;
    let name = text.split([',', ';']).next()?;
    let is_ours = ["INSPVAA", "INSPVASA", "INSPVAXA"].contains(&name);
    if !is_ours {
        return (name.len() > 3 && name.bytes().all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit()))
            .then_some((Message::Other, length));
    }
    Some((decoded(text, name).unwrap_or(Message::Damaged), length))
}

fn decoded(text: &str, name: &str) -> Option<Message> {
    let (content, crc) = text.split_once('*')?;
    if u32::from_str_radix(crc.trim(), 16).ok()? != crc32(content.as_bytes()) {
        return None;
    }
    let (header, body) = content.split_once(';')?;
    let fields: Vec<&str> = body.split(',').map(str::trim).collect();
    if name == "INSPVAXA" {
        // A long header has the week after port, sequence, idle time and time status.
        let header: Vec<&str> = header.split(',').collect();
        let at = if header.len() > 6 { 5 } else { 1 };
        let week = header.get(at)?.trim().parse().ok()?;
        let second = header.get(at + 1)?.trim().parse().ok()?;
        let all: [f64; 10] = numbers(&fields, 2)?;
        let [latitude, longitude, height, undulation_m, rest @ ..] = all;
        let [vn, ve, vu, roll, pitch, azimuth] = rest;
        let pose_numbers = [latitude, longitude, height, vn, ve, vu, roll, pitch, azimuth];
        let pose = NovatelPose::new(week, second, pose_numbers, undulation_m)?;
        let deviation = NovatelDeviation::new(week, second, numbers(&fields, 12)?);
        return Some(Message::Extended { pose, deviation, is_ready: is_ready(fields.first()?) });
    }
    let week = fields.first()?.parse().ok()?;
    let second = fields.get(1)?.parse().ok()?;
    let pose = NovatelPose::new(week, second, numbers(&fields, 2)?, 0.0)?;
    Some(Message::Pose { pose, is_ready: is_ready(fields.get(11)?) })
}

fn numbers<const N: usize>(fields: &[&str], first: usize) -> Option<[f64; N]> {
    let mut numbers = [0.0; N];
    for (number, field) in numbers.iter_mut().zip(fields.get(first..first + N)?) {
        *number = field.parse().ok()?;
    }
    Some(numbers)
}

fn is_ready(status: &str) -> bool {
    READY.iter().any(|(ready, _)| *ready == status)
}
