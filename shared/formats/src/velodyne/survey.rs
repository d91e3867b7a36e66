//! A look at the beginning of a recording: which sensor, which port, whose clock.

use super::capture::Captures;
use super::clock::{Clock, TimeBase};
use super::{DataPacket, LidarStats, Model, PositionPacket};
use crate::nmea::{self, Sentence};
use crate::pcap::PcapError;
use geometry::Stamp;

/// Packets that are looked at: two seconds of an HDL-32E with its position packets; a receiver speaks every second.
const LOOK: usize = 4096;
/// Data packets whose times are compared.
const TIMES: usize = 64;

/// What the beginning shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Survey {
    pub(super) model: Model,
    /// Port of the data packets.
    pub(super) port: u16,
    pub(super) clock: Clock,
}

/// What can be said of a recording's beginning.
#[derive(Clone, Debug)]
pub(super) enum Look {
    /// All that is to be found.
    Settled(Survey),
    /// No data packet of a known sensor (of the model that was asked for); what is wrong with damaged captures.
    NoSensor(Vec<String>),
    /// The recording has only begun: what is still to come may say more.
    TooEarly,
}

/// Looks at captures from their beginning.
pub(super) fn survey(mut captures: Captures, model: Option<Model>) -> Result<Look, PcapError> {
    let mut stats = LidarStats::default();
    let mut found: Option<(Model, u16)> = None;
    let mut times: Vec<(u32, Stamp)> = Vec::new();
    let mut host_ahead_nanos = None;
    for _ in 0..LOOK {
        let Some(arrival) = captures.next(&mut stats)? else {
            if captures.is_waiting() {
                return Ok(Look::TooEarly);
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
    let Some((model, port)) = found else { return Ok(Look::NoSensor(captures.damage().to_vec())) };
    let clock = Clock::new(time_base(&times), host_ahead_nanos.unwrap_or_default());
    Ok(Look::Settled(Survey { model, port, clock }))
}

/// How far the capturing machine is ahead of the satellites; `None` without a fix.
fn host_ahead(packet: &PositionPacket<'_>, captured: Stamp) -> Option<i64> {
    match nmea::parse(packet.nmea) {
        Ok(Sentence::Rmc(rmc)) if rmc.is_valid => rmc.stamp.map(|stamp| captured.0 - stamp.0),
        _ => None,
    }
}

/// The sensor's clock if it goes as the capture's does.
fn time_base(times: &[(u32, Stamp)]) -> TimeBase {
    let mut clock = Clock::new(TimeBase::Sensor, 0);
    let steps = times.iter().map(|(micros, captured)| clock.step(*micros, *captured));
    let n_forward = steps.filter(|step| matches!(step, super::clock::Step::Forward { .. })).count();
    if n_forward * 2 > times.len() { TimeBase::Sensor } else { TimeBase::Capture }
}
