//! Reads sweeps from captures, one at a time, in bounded memory.

mod arrivals;
mod slices;

pub use slices::{SliceInfo, SlicePoll};

use super::capture::Captures;
use super::clock::Clock;
use super::decoder::PacketDecoder;
use super::detect::{Detection, MAX_EXAMINED, StreamInfo, detect};
use super::field_of_view::SilentSector;
use super::maker::{Cut, MAX_RETURNS_PER_PACKET};
use super::receiver::Receiver;
use super::reorder::{Held, Place, Reorder, WINDOW};
use super::revolutions::{End, MAX_RETURNS, Revolution};
use super::source::Source;
use super::{Blocks, Lidar, LidarStats, Model, Scratch, TURN};
use crate::nmea::{Fix, LogStats};
use crate::pcap::{Frontier, PcapError};
use geometry::Stamp;
use messages::SweepPoint;
use serde::{Deserialize, Serialize};
use std::net::SocketAddrV4;
use std::path::PathBuf;

/// Error of captures from which no sweeps can be read.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// A capture cannot be read.
    #[error(transparent)]
    Capture(#[from] PcapError),
    /// The captures contain no packets of a supported sensor.
    #[error("{path}: no data packet of {wanted} in the first {MAX_EXAMINED} UDP packets{reasons}", path = path.display())]
    NoSensor {
        /// The first capture.
        path: PathBuf,
        /// Models that were searched.
        wanted: String,
        /// Sensors of other models and errors of damaged captures, each with a leading `; `.
        reasons: String,
    },
    /// A saved position does not belong to these captures.
    #[error("no data packet at byte {offset} of {path}; was the file changed after the position was saved?", path = path.display())]
    Position {
        /// The capture.
        path: PathBuf,
        /// Offset of the position.
        offset: u64,
    },
}

/// Properties of a complete sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepInfo {
    /// Number of the revolution in the recording. The first and the last are usually incomplete.
    pub seq: u64,
    /// Time of its first firing, with or without a return.
    pub stamp: Stamp,
    /// Time from the stamp to the first firing of the next revolution, ns.
    pub duration_nanos: u32,
    /// Number of returns.
    pub n_returns: usize,
    /// Data packets lost inside the sweep.
    pub lost_packets: u64,
    /// Part of a revolution between its first and last block, 0 to 1.
    pub turn: f64,
    /// Whether its points have times.
    pub has_times: bool,
}

/// Result of [`SweepReader::poll_sweep`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SweepPoll {
    /// The sweep is complete.
    Sweep(SweepInfo),
    /// The sweep is incomplete, and the recording is still being written.
    Pending,
    /// The recording has ended.
    End,
}

/// A position between two sweeps from which reading can continue ([`SweepReader::resume`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SweepPosition {
    seq: u64,
    clock: Clock,
    stats: LidarStats,
    receiver: Receiver,
    source: Source,
    packet: Option<PacketPosition>,
    /// Packets that were read and wait for earlier ones.
    held: [Option<Place>; WINDOW],
    /// The last packet that was read, of any sender.
    read: Option<Place>,
    ended: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct PacketPosition {
    place: Place,
    stamp: Stamp,
    /// First block that does not belong to a sweep yet.
    block: usize,
}

/// Times of a data packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PacketArrival {
    /// Time by the clock of the sensor.
    pub stamp: Stamp,
    /// Time by the clock of the host.
    pub captured: Stamp,
}

/// Reads the sweeps of a recording.
#[derive(Debug)]
pub struct SweepReader {
    captures: Captures,
    decoder: PacketDecoder,
    cut: Cut,
    /// Bytes of a packet, and time to the next one, ns.
    typical_packet: (u64, u64),
    sensor: SocketAddrV4,
    port: u16,
    silent_sector: Option<SilentSector>,
    at: SweepPosition,
    reorder: Reorder,
    /// Payload and blocks of the current packet.
    bytes: Vec<u8>,
    blocks: Blocks,
    /// Buffers of packets that were read, for the next ones.
    spare: Vec<Vec<u8>>,
    scratch: Box<Scratch<MAX_RETURNS_PER_PACKET>>,
    /// The sweep being read.
    revolution: Option<Revolution>,
    /// Packets lost inside that sweep so far.
    lost_packets: u64,
    fixes: Vec<Fix>,
    /// The packet with the least delay.
    arrival: Option<PacketArrival>,
    /// The slice being read.
    slice: Option<SliceInfo>,
    /// Senders and ports of the other LiDARs of the drive.
    others: Vec<(SocketAddrV4, u16)>,
}

impl SweepReader {
    /// Most returns of a sweep.
    pub const MAX_RETURNS: usize = MAX_RETURNS + MAX_RETURNS_PER_PACKET;

    /// Opens a recording, which may consist of several captures. Without `lidar`, the model is the one that sent most
    /// data packets in the first second, excluding Ouster.
    pub fn open(files: Vec<PathBuf>, lidar: Option<&Lidar>) -> Result<Self, SweepError> {
        match detect(Captures::new(files.clone()), lidar)? {
            Detection::Found(stream) => Ok(Self::new(Captures::new(files), &stream)),
            Detection::NoSensor(reasons) => Err(no_sensor(files, lidar, &reasons)),
            Detection::NeedsMorePackets => Err(no_sensor(files, lidar, &[])),
        }
    }

    /// Reads the last file of a recording while it is being written. Earlier files of the recording are used to detect the stream, as
    /// in [`SweepReader::open`], and are skipped. `None` if the stream cannot be detected yet; this needs up to 4096 packets. Call
    /// again when more packets are written.
    pub fn follow(files: Vec<PathBuf>, frontier: &Frontier, lidar: Option<&Lidar>) -> Result<Option<Self>, SweepError> {
        let captures = || Captures::follow(files.clone(), frontier.clone());
        let mut detection = detect(captures(), lidar)?;
        if let (Detection::Found(first), None) = (&detection, lidar) {
            // A later run opens the recording with the model, which also accepts packets without product byte. Detecting again
            // with the model gives the same result as that run.
            let found = first.lidar.clone();
            detection = detect(captures(), Some(&found))?;
        }
        match detection {
            Detection::Found(stream) => {
                let mut captures = captures();
                captures.skip_to_last();
                Ok(Some(Self::new(captures, &stream)))
            }
            Detection::NeedsMorePackets => Ok(None),
            Detection::NoSensor(reasons) => Err(no_sensor(files, lidar, &reasons)),
        }
    }

    fn new(captures: Captures, stream: &StreamInfo) -> Self {
        let stats = LidarStats::default();
        let receiver = Receiver::default();
        let decoder = PacketDecoder::new(&stream.lidar).across(stream.silent_sector);
        Self {
            captures,
            cut: decoder.cut(),
            typical_packet: (stream.payload.len() as u64, decoder.blocks(&stream.payload).packet_nanos.max(1) as u64),
            decoder,
            sensor: stream.sensor,
            port: stream.port,
            silent_sector: stream.silent_sector,
            at: SweepPosition {
                seq: 0,
                clock: stream.clock,
                stats,
                receiver,
                source: Source::new(stream.sensor),
                packet: None,
                held: [None; WINDOW],
                read: None,
                ended: false,
            },
            reorder: Reorder::default(),
            bytes: Vec::new(),
            blocks: Blocks::default(),
            spare: Vec::new(),
            scratch: Box::default(),
            revolution: None,
            lost_packets: 0,
            fixes: Vec::new(),
            arrival: None,
            slice: None,
            others: Vec::new(),
        }
    }

    /// Continues at a position that [`SweepReader::position`] returned for the same captures.
    pub fn resume(&mut self, position: &SweepPosition) -> Result<(), SweepError> {
        self.at = position.clone();
        self.revolution = None;
        self.slice = None;
        self.lost_packets = 0;
        self.fixes.clear();
        self.reorder.clear();
        let Some(current) = position.packet else { return Ok(()) };
        let held = || position.held.into_iter().flatten();
        let first = held().fold(current.place, Place::min);
        let begin = held().filter(|held| held.file == first.file).map(|held| held.begin);
        let begin = begin.chain((current.place.file == first.file).then_some(current.place.begin)).min();
        let begin = begin.unwrap_or(first.begin);
        self.captures.seek(first.file, begin)?;
        let mut n_missing = 1 + held().count();
        self.at.read = None;
        let end = |place: Place| (place.file, place.offset);
        while self.at.read.map(end) < position.read.map(end) {
            // The packets were counted when they were read first.
            let Some(arrival) = self.captures.next(&mut LidarStats::default())? else { break };
            let place = Place { file: arrival.file, offset: arrival.offset, begin: arrival.begin };
            self.at.read = Some(place);
            let payload = self.captures.payload();
            let lidar = self.decoder.lidar();
            if !lidar.may_have_sent(payload) {
                continue;
            }
            // A packet in fragments is identified by its last one.
            let is_at = |other: Place| (other.file, other.offset) == (place.file, place.offset);
            if is_at(current.place) {
                self.bytes = payload.to_vec();
                self.blocks = self.decoder.blocks(payload);
                n_missing -= 1;
            } else if let Some(place) = held().find(|held| is_at(*held)) {
                let captured = arrival.captured;
                let nanos = lidar.packet_nanos(payload);
                self.reorder.push(Held { place, captured, nanos, bytes: payload.to_vec() });
                n_missing -= 1;
            }
        }
        if n_missing == 0 && current.block <= self.blocks.len() && self.at.read.map(end) == position.read.map(end) {
            self.at.read = position.read;
            return Ok(());
        }
        let path = self.captures.files().get(first.file).cloned().unwrap_or_default();
        Err(SweepError::Position { path, offset: first.offset })
    }

    /// Position of the next sweep.
    pub fn position(&self) -> SweepPosition {
        SweepPosition { held: self.reorder.places(), ..self.at.clone() }
    }

    /// The sensor.
    pub fn lidar(&self) -> &Lidar {
        self.decoder.lidar()
    }

    /// Model of the sensor.
    pub fn model(&self) -> Model {
        self.lidar().model()
    }

    /// Number of rings of the sensor; 0 for a sensor without rings.
    pub fn n_rings(&self) -> usize {
        self.decoder.n_rings()
    }

    /// Payload of the first data packet, bytes, and time to the next one, ns.
    pub fn typical_packet(&self) -> (u64, u64) {
        self.typical_packet
    }

    /// Counters since the start of the recording.
    pub fn stats(&self) -> LidarStats {
        self.at.stats
    }

    /// Errors of damaged captures, one text per capture.
    pub fn damage(&self) -> &[String] {
        self.captures.damage()
    }

    /// Index of the file and offset of the last packet that was read.
    pub fn place(&self) -> (usize, u64) {
        self.at.packet.map_or((0, 0), |packet| (packet.place.file, packet.place.offset))
    }

    /// Fixes of the position packets read since the last call. A fix is complete when the next sentence of the receiver or the end of the
    /// recording was read.
    pub fn take_fixes(&mut self) -> Vec<Fix> {
        std::mem::take(&mut self.fixes)
    }

    /// The data packet with the smallest delay from stamp to capture, among those read since the last call. The
    /// difference is the offset of the clocks of sensor and host, and the delay of the network.
    pub fn take_arrival(&mut self) -> Option<PacketArrival> {
        self.arrival.take()
    }

    /// Sentence counters of the position packets since the start of the recording.
    pub fn log_stats(&self) -> LogStats {
        self.at.receiver.stats()
    }

    /// Passes the returns of the next sweep to `sink` in firing order, at most 4096 at a time and at most [`SweepReader::MAX_RETURNS`] in
    /// all. `None` at the end of the recording, or if no more packets are written yet.
    pub fn next_sweep(&mut self, sink: impl FnMut(&[SweepPoint])) -> Result<Option<SweepInfo>, SweepError> {
        match self.poll_sweep(sink)? {
            SweepPoll::Sweep(info) => Ok(Some(info)),
            SweepPoll::Pending | SweepPoll::End => Ok(None),
        }
    }

    /// Like [`SweepReader::next_sweep`], for recordings that are being written. After [`SweepPoll::Pending`] the next call continues the
    /// same sweep and passes only new returns.
    pub fn poll_sweep(&mut self, mut sink: impl FnMut(&[SweepPoint])) -> Result<SweepPoll, SweepError> {
        let mut revolution = self.revolution.take();
        let end = loop {
            if self.at.packet.is_none_or(|place| place.block >= self.blocks.len()) {
                match self.next_packet()? {
                    Some(n_lost) => self.lost_packets += n_lost,
                    None if self.at.ended => break None,
                    None => {
                        self.revolution = revolution;
                        return Ok(SweepPoll::Pending);
                    }
                }
            }
            if let Some(end) = self.take_blocks(&mut revolution, &mut sink) {
                break Some(end);
            }
        };
        let lost_packets = std::mem::take(&mut self.lost_packets);
        let Some(revolution) = revolution else { return Ok(SweepPoll::End) };
        let end_nanos = match end {
            Some((End::Wrapped, at)) => at,
            Some((End::Forced, _)) | None => revolution.last() + self.blocks.block_nanos,
        };
        let full = if let Cut::Turn { full } = self.cut { full } else { TURN };
        let seq = self.at.seq;
        self.at.seq += 1;
        self.at.stats.forced_ends += u64::from(matches!(end, Some((End::Forced, _))));
        Ok(SweepPoll::Sweep(SweepInfo {
            seq,
            stamp: Stamp(revolution.begin),
            duration_nanos: (end_nanos - revolution.begin).clamp(0, i64::from(u32::MAX)) as u32,
            n_returns: revolution.n_returns,
            lost_packets,
            turn: revolution.share(full),
            has_times: true,
        }))
    }

    /// Adds the next blocks of the packet to the revolution, up to the end of the packet or of the revolution.
    fn take_blocks(
        &mut self,
        revolution: &mut Option<Revolution>,
        sink: &mut impl FnMut(&[SweepPoint]),
    ) -> Option<(End, i64)> {
        let place = self.at.packet.as_mut()?;
        let first = place.block;
        let mut end = None;
        while place.block < self.blocks.len() {
            if let Some((nanos, turned)) = self.blocks.get(place.block) {
                let at = place.stamp.0 + nanos;
                let turned = match self.cut {
                    Cut::Turn { .. } => turned,
                    Cut::Time { nanos } => (at.rem_euclid(nanos) as f64 / nanos as f64 * f64::from(TURN)) as u16,
                };
                let taken = revolution.get_or_insert_with(|| Revolution::begin(at, turned)).take(at, turned);
                if let Err(reason) = taken {
                    end = Some((reason, at));
                    break;
                }
            }
            place.block += 1;
        }
        if let Some(revolution) = revolution {
            let packet_nanos = place.stamp.0 - revolution.begin;
            self.decoder.decode(&self.bytes, first..place.block, packet_nanos, &mut self.scratch);
            revolution.n_returns += self.scratch.len;
            sink(self.scratch.returns());
        }
        end
    }
}

fn no_sensor(files: Vec<PathBuf>, lidar: Option<&Lidar>, reasons: &[String]) -> SweepError {
    let wanted = match lidar {
        Some(lidar) => match lidar.missing_file() {
            None => lidar.model().name().to_owned(),
            Some(file) => format!("{}, which needs {file},", lidar.model().name()),
        },
        None => Model::names(),
    };
    let reasons = reasons.iter().flat_map(|text| ["; ", text]).collect();
    SweepError::NoSensor { path: files.into_iter().next().unwrap_or_default(), wanted, reasons }
}
