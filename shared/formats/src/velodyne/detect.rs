//! Detects sensor model, port and clock from the beginning of a recording.

use super::capture::Captures;
use super::clock::{Clock, TimeBase};
use super::{DataPacket, LidarStats, Model, PositionPacket};
use crate::nmea::{self, Sentence};
use crate::pcap::PcapError;
use geometry::Stamp;

/// Packets that are examined: two seconds of an HDL-32E with its position packets. A receiver sends a sentence every second.
const MAX_PACKETS: usize = 4096;
/// Data packets whose times are compared.
const TIMES: usize = 64;

/// Properties of a packet stream.
#[derive(Clone, Copy, Debug)]
pub(super) struct StreamInfo {
    pub(super) model: Model,
    /// Port of the data packets.
    pub(super) port: u16,
    pub(super) clock: Clock,
}

/// Result of the detection.
#[derive(Clone, Debug)]
pub(super) enum Detection {
    /// All properties are known.
    Found(StreamInfo),
    /// There is no data packet of a supported sensor, or of the requested model. Contains the errors of damaged captures.
    NoSensor(Vec<String>),
    /// The recording is still being written, and later packets may change the result.
    NeedsMorePackets,
}

/// Examines captures from their beginning. With `model`, only packets of this model are considered.
pub(super) fn detect(mut captures: Captures, model: Option<Model>) -> Result<Detection, PcapError> {
    let mut stats = LidarStats::default();
    let mut found: Option<(Model, u16)> = None;
    let mut times: Vec<(u32, Stamp)> = Vec::new();
    let mut host_ahead_nanos = None;
    for _ in 0..MAX_PACKETS {
        let Some(arrival) = captures.next(&mut stats)? else {
            if captures.is_waiting() {
                return Ok(Detection::NeedsMorePackets);
            }
            break;
        };
        if let Some(packet) = PositionPacket::new(captures.payload()) {
            host_ahead_nanos = host_ahead_nanos.or_else(|| host_ahead(&packet, arrival.captured));
        }
        let Some(packet) = DataPacket::new(captures.payload()) else { continue };
        let Some(sender) = model.filter(|model| model.may_have_sent(packet)).or(match model {
            Some(_) => None,
            None => Model::of_packet(packet),
        }) else {
            continue;
        };
        found.get_or_insert((sender, arrival.port));
        if times.len() < TIMES {
            times.push((packet.micros(), arrival.captured));
        } else if host_ahead_nanos.is_some() {
            break;
        }
    }
    let Some((model, port)) = found else { return Ok(Detection::NoSensor(captures.damage().to_vec())) };
    let clock = Clock::new(time_base(&times), host_ahead_nanos.unwrap_or_default());
    Ok(Detection::Found(StreamInfo { model, port, clock }))
}

/// Offset of the capturing machine from GNSS time; `None` without a fix.
fn host_ahead(packet: &PositionPacket<'_>, captured: Stamp) -> Option<i64> {
    match nmea::parse(packet.nmea) {
        Ok(Sentence::Rmc(rmc)) if rmc.is_valid => rmc.stamp.map(|stamp| captured.0 - stamp.0),
        _ => None,
    }
}

/// The clock of the sensor if it runs like the clock of the capture.
fn time_base(times: &[(u32, Stamp)]) -> TimeBase {
    let mut clock = Clock::new(TimeBase::Sensor, 0);
    let steps = times.iter().map(|(micros, captured)| clock.step(*micros, *captured));
    let n_forward = steps.filter(|step| matches!(step, super::clock::Step::Forward { .. })).count();
    if n_forward * 2 > times.len() { TimeBase::Sensor } else { TimeBase::Capture }
}
