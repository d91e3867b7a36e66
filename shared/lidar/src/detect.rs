//! Detects sensor, model, port and clock from the beginning of a recording.
//!
//! The sender of most data packets at the start is the sensor: of one second if its position packets have a fix, otherwise
//! of three seconds or 4096 packets. A single stray packet, or a second sensor that sends fewer packets, does not change
//! the result.

use super::capture::{Arrival, Captures};
use super::clock::{Clock, Epoch, Step, TimeBase};
use super::decoder::PacketDecoder;
use super::field_of_view::{FiredAngles, SilentSector};
use super::{Lidar, LidarStats, Model};
use crate::nmea::{self, Sentence};
use crate::pcap::{PcapError, unread_frames};
use crate::velodyne::{DataPacket, PositionPacket};
use geometry::Stamp;
use std::collections::BTreeMap;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::PathBuf;

/// Time after the first data packet that is examined in any case, ns.
const SPAN_NANOS: i64 = 1_000_000_000;
/// Data and position packets that are examined: two seconds of an HDL-32E. A receiver sends a sentence every second.
const MAX_PACKETS: usize = 4096;
/// Time after the first data packet within which a fix of the receiver is awaited, ns.
const MAX_SPAN_NANOS: i64 = 3_000_000_000;
/// Senders of other data packets that are reported.
const MAX_OTHERS: usize = 8;
/// Senders whose calibration is kept.
const MAX_CALIBRATIONS: usize = 8;
/// UDP packets that are examined. Other devices on the network of the sensor send more packets than it does.
pub(super) const MAX_EXAMINED: usize = 65_536;
/// Data packets whose times are compared.
const TIMES: usize = 64;

/// Properties of a packet stream.
#[derive(Clone, Debug)]
pub(super) struct StreamInfo {
    pub(super) lidar: Lidar,
    /// Address and port from which the sensor sends data packets.
    pub(super) sensor: SocketAddrV4,
    /// Port to which the data packets are sent.
    pub(super) port: u16,
    pub(super) clock: Clock,
    /// The first data packet.
    pub(super) payload: Vec<u8>,
    /// Where the sensor is set to fire nothing.
    pub(super) silent_sector: Option<SilentSector>,
}

/// Result of the detection.
#[derive(Clone, Debug)]
pub(super) enum Detection {
    /// All properties are known.
    Found(StreamInfo),
    /// There is no data packet of a supported sensor, or of the requested model. Contains the other sensors that were found and the
    /// errors of damaged captures.
    NoSensor(Vec<String>),
    /// The recording is still being written, and later packets may change the result.
    NeedsMorePackets,
}

/// A possible sensor: where its data packets come from and go to.
struct Candidate {
    lidar: Lidar,
    sensor: SocketAddrV4,
    port: u16,
    n_packets: usize,
    /// Sensor and capture times of its first packets.
    times: Vec<(i64, Stamp)>,
    /// Its first packet.
    payload: Vec<u8>,
    /// `None` if the packets cannot be decoded without a file.
    decoder: Option<PacketDecoder>,
    angles: FiredAngles,
}

/// Results of the search so far.
#[derive(Default)]
struct Search {
    candidates: Vec<Candidate>,
    /// Offset of the capturing machine from GNSS time, by the address of the sender.
    host_ahead_nanos: BTreeMap<Ipv4Addr, i64>,
    /// Packets with the state of a device, by the address of the sender.
    devices: BTreeMap<Ipv4Addr, Vec<u8>>,
    /// Data packets that are not considered, by sender and name of the model.
    others: BTreeMap<(SocketAddrV4, String), usize>,
    /// Capture time of the first data packet.
    first: Option<Stamp>,
    n_packets: usize,
}

impl Lidar {
    /// The LiDAR with the calibration that the packets of a recording contain, if no file has it.
    #[must_use]
    pub fn with_calibration_of(self, files: &[PathBuf]) -> Self {
        if !self.receives_calibration() || files.is_empty() {
            return self;
        }
        // Errors of a capture are reported when it is read.
        match detect(Captures::new(files.to_vec()), Some(&self)) {
            Ok(Detection::Found(stream)) => stream.lidar,
            _ => self,
        }
    }
}

/// Examines captures from their beginning. With `lidar`, only packets of this model are considered.
pub(super) fn detect(mut captures: Captures, lidar: Option<&Lidar>) -> Result<Detection, PcapError> {
    let mut stats = LidarStats::default();
    let mut search = Search::default();
    for _ in 0..MAX_EXAMINED {
        let Some(arrival) = captures.next(&mut stats)? else {
            if captures.is_waiting() {
                return Ok(Detection::NeedsMorePackets);
            }
            break;
        };
        search.add(&arrival, captures.payload(), lidar);
        if search.n_packets >= MAX_PACKETS || search.is_complete(arrival.captured) {
            break;
        }
    }
    let unread = || captures.files().first().map(|file| unread_frames(file)).unwrap_or_default();
    let reasons = || search.others().chain(captures.damage().iter().cloned()).chain(unread()).collect();
    Ok(search.result().map_or_else(|| Detection::NoSensor(reasons()), Detection::Found))
}

impl Search {
    fn add(&mut self, arrival: &Arrival, payload: &[u8], wanted: Option<&Lidar>) {
        if let Some(packet) = PositionPacket::new(payload) {
            self.n_packets += 1;
            if let Some(nanos) = host_ahead(&packet, arrival.captured) {
                self.host_ahead_nanos.entry(*arrival.source.ip()).or_insert(nanos);
            }
        }
        let is_kept = self.devices.len() < MAX_CALIBRATIONS && !self.devices.contains_key(arrival.source.ip());
        if is_kept && Model::is_device_packet(payload) {
            self.devices.insert(*arrival.source.ip(), payload.to_vec());
        }
        let named = Model::from_payload(payload);
        let found = match wanted {
            Some(lidar) => (lidar.may_come_from(arrival.source, arrival.port) && lidar.may_have_sent(payload))
                .then(|| lidar.clone()),
            None => named.map(Lidar::from),
        };
        let Some(lidar) = found else {
            let other = other_name(named, wanted, payload);
            self.n_packets += usize::from(other.is_some());
            if let Some(name) = other {
                self.add_other(arrival.source, name);
            }
            return;
        };
        self.n_packets += 1;
        self.first.get_or_insert(arrival.captured);
        let sensor = arrival.source;
        let port = arrival.port;
        let is_same = |one: &Candidate| (one.lidar.model(), one.sensor, one.port) == (lidar.model(), sensor, port);
        let known = self.candidates.iter().position(is_same);
        let nanos = lidar.packet_nanos(payload);
        let index = known.unwrap_or_else(|| {
            let payload = payload.to_vec();
            let decoder = lidar.missing_file().is_none().then(|| PacketDecoder::new(&lidar));
            let decoder = decoder.filter(PacketDecoder::is_regular);
            let angles = FiredAngles::default();
            let times = Vec::new();
            self.candidates.push(Candidate { lidar, sensor, port, n_packets: 0, times, payload, decoder, angles });
            self.candidates.len() - 1
        });
        let candidate = &mut self.candidates[index];
        candidate.n_packets += 1;
        if let Some(decoder) = &candidate.decoder {
            candidate.angles.add(&decoder.blocks(payload), arrival.captured);
        }
        if candidate.times.len() < TIMES {
            candidate.times.push((nanos, arrival.captured));
        }
    }

    fn add_other(&mut self, source: SocketAddrV4, name: String) {
        let key = (source, name);
        if self.others.len() < MAX_OTHERS || self.others.contains_key(&key) {
            *self.others.entry(key).or_default() += 1;
        }
    }

    /// The sensors that are not considered.
    fn others(&self) -> impl Iterator<Item = String> {
        self.others.iter().map(|((source, name), n)| format!("{n} data packets of {name} come from {source}"))
    }

    /// The candidate with most packets; the first of several.
    fn best(&self) -> Option<&Candidate> {
        self.candidates.iter().rev().max_by_key(|candidate| candidate.n_packets)
    }

    /// Whether enough packets were examined.
    fn is_complete(&self, now: Stamp) -> bool {
        let is_after = |nanos: i64| self.first.is_some_and(|first| now.0.saturating_sub(first.0) >= nanos);
        if is_after(MAX_SPAN_NANOS) {
            return true;
        }
        let is_over = is_after(SPAN_NANOS);
        let is_known =
            |one: &Candidate| one.times.len() == TIMES && self.host_ahead_nanos.contains_key(one.sensor.ip());
        is_over && self.best().is_some_and(is_known)
    }

    fn result(&self) -> Option<StreamInfo> {
        let Candidate { lidar, sensor, port, times, payload, angles, .. } = self.best()?;
        let silent_sector = angles.silent_sector();
        let host_ahead_nanos = self.host_ahead_nanos.get(sensor.ip()).copied().unwrap_or_default();
        let epoch = lidar.epoch();
        let clock = Clock::new(time_base(times, epoch), epoch, host_ahead_nanos);
        let payload = payload.clone();
        let device = self.devices.get(sensor.ip());
        let lidar = device.and_then(|packet| lidar.with_device_packet(packet)).unwrap_or_else(|| lidar.clone());
        if lidar.missing_file().is_some() {
            return None;
        }
        Some(StreamInfo { lidar, sensor: *sensor, port: *port, clock, payload, silent_sector })
    }
}

/// Name of the sensor of a data packet that is not considered; `None` if it is not a data packet of a LiDAR.
fn other_name(named: Option<Model>, wanted: Option<&Lidar>, payload: &[u8]) -> Option<String> {
    if let Some(number) = wanted.and_then(|lidar| lidar.unit.other_serial_number(payload)) {
        return Some(format!("an Ouster with serial number {number}, which differs from the metadata file,"));
    }
    if let Some(model) = named {
        return Some(model.name().to_owned());
    }
    if let Some(packet) = DataPacket::new(payload) {
        return Some(format!("an unknown sensor (product byte {:#04x})", packet.product()));
    }
    Model::may_be_ouster(payload).then(|| {
        "a sensor that may be an Ouster (set lidar.model = \"ouster\" and lidar.calibration to its metadata file)"
            .to_owned()
    })
}

/// Offset of the capturing machine from GNSS time; `None` without a fix.
fn host_ahead(packet: &PositionPacket<'_>, captured: Stamp) -> Option<i64> {
    match nmea::parse(packet.nmea) {
        Ok(Sentence::Rmc(rmc)) if rmc.is_valid => rmc.stamp.map(|stamp| captured.0 - stamp.0),
        _ => None,
    }
}

/// The clock of the sensor if it runs at the same rate as the clock of the capture. Packets in a different order do not
/// count against it.
fn time_base(times: &[(i64, Stamp)], epoch: Epoch) -> TimeBase {
    let mut clock = Clock::new(TimeBase::Sensor, epoch, 0);
    let steps = times.iter().map(|(nanos, captured)| clock.step(*nanos, *captured));
    let n_plausible = steps.filter(|step| matches!(step, Step::Forward { .. } | Step::Late)).count();
    if n_plausible * 2 > times.len() { TimeBase::Sensor } else { TimeBase::Capture }
}
