//! Captures into sweeps, one after the other, in bounded memory.

use super::capture::{Arrival, Captures};
use super::clock::{Clock, Step};
use super::decode::{Decoder, LidarReturn, Scratch};
use super::packet::{
    BLOCKS_PER_PACKET, DATA_PACKET_BYTES, DATA_PORT, DataPacket, MAX_RETURNS_PER_PACKET, POSITION_PORT,
};
use super::revolutions::{End, MAX_RETURNS, Revolution};
use super::survey::survey;
use super::{LidarStats, Model, PositionPacket};
use crate::pcap::PcapError;
use geometry::Stamp;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Why captures give no sweeps.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// A file cannot be read.
    #[error(transparent)]
    Capture(#[from] PcapError),
    /// There is nothing of a sensor in them.
    #[error("{path}: no data packet of {wanted} in the first 4096 UDP packets", path = path.display())]
    NoSensor {
        /// The first capture.
        path: PathBuf,
        /// The models that would do.
        wanted: String,
    },
    /// A saved position that cannot be of these captures.
    #[error("saved position at byte {offset} of {path} is no data packet there", path = path.display())]
    Position {
        /// The capture.
        path: PathBuf,
        /// Where.
        offset: u64,
    },
}

/// What a sweep is, once it is complete.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepInfo {
    /// Number of the revolution in the recording. The first and the last one are usually not whole.
    pub seq: u64,
    /// Of its first firing, whether that had a return or not.
    pub stamp: Stamp,
    /// ns from the stamp to the first firing of the next revolution.
    pub duration_nanos: u32,
    /// Points.
    pub n_returns: usize,
    /// Data packets missing inside.
    pub lost_packets: u64,
    /// Share of a turn between its first and last block, 0 to 1.
    pub turn: f64,
}

/// A place between two sweeps, from which reading can go on ([`SweepReader::resume`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SweepPosition {
    seq: u64,
    clock: Clock,
    stats: LidarStats,
    packet: Option<PacketPlace>,
    ended: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct PacketPlace {
    file: usize,
    offset: u64,
    stamp: Stamp,
    /// The first block that belongs to no sweep yet.
    block: usize,
}

/// Reads the sweeps of a recording.
#[derive(Debug)]
pub struct SweepReader {
    captures: Captures,
    decoder: Decoder,
    port: u16,
    at: SweepPosition,
    bytes: [u8; DATA_PACKET_BYTES],
    slots: [u8; BLOCKS_PER_PACKET],
    scratch: Box<Scratch>,
}

impl SweepReader {
    /// The most returns that a sweep can have.
    pub const MAX_RETURNS: usize = MAX_RETURNS + MAX_RETURNS_PER_PACKET;

    /// Looks at the beginning of the captures, which are one recording cut into files. Without a model, the first data
    /// packet tells.
    pub fn open(files: Vec<PathBuf>, model: Option<Model>) -> Result<Self, SweepError> {
        let Some(survey) = survey(&files, model)? else {
            let wanted = model.map_or_else(|| Model::ALL.map(Model::name).join(", "), |model| model.name().to_owned());
            return Err(SweepError::NoSensor { path: files.into_iter().next().unwrap_or_default(), wanted });
        };
        let stats = LidarStats::default();
        Ok(Self {
            captures: Captures::new(files),
            decoder: Decoder::new(survey.model),
            port: survey.port,
            at: SweepPosition { seq: 0, clock: survey.clock, stats, packet: None, ended: false },
            bytes: [0; DATA_PACKET_BYTES],
            slots: [0; BLOCKS_PER_PACKET],
            scratch: Box::default(),
        })
    }

    /// Goes to a place that [`SweepReader::position`] gave for the same captures.
    pub fn resume(&mut self, position: SweepPosition) -> Result<(), SweepError> {
        self.at = position;
        let Some(place) = position.packet else { return Ok(()) };
        self.captures.seek(place.file, place.offset)?;
        // It was counted when it was read first.
        let mut stats = LidarStats::default();
        let arrival = self.captures.next(&mut stats)?;
        let found = arrival.filter(|arrival| (arrival.file, arrival.offset) == (place.file, place.offset));
        match DataPacket::new(self.captures.payload()) {
            Some(packet) if found.is_some() && place.block <= BLOCKS_PER_PACKET => {
                self.bytes = *packet.bytes();
                self.slots = self.decoder.slots(packet);
                Ok(())
            }
            _ => {
                let path = self.captures.files().get(place.file).cloned().unwrap_or_default();
                Err(SweepError::Position { path, offset: place.offset })
            }
        }
    }

    /// Where the next sweep begins.
    pub fn position(&self) -> SweepPosition {
        self.at
    }

    /// Whose packets these are.
    pub fn model(&self) -> Model {
        self.decoder.model()
    }

    /// Counts since the start of the recording.
    pub fn stats(&self) -> LidarStats {
        self.at.stats
    }

    /// What is wrong with damaged captures, one text each.
    pub fn damage(&self) -> &[String] {
        self.captures.damage()
    }

    /// Number of the file and byte in it up to which has been read.
    pub fn place(&self) -> (usize, u64) {
        self.at.packet.map_or((0, 0), |place| (place.file, place.offset))
    }

    /// Hands the returns of the next sweep to `sink`, in the order of firing, at most 384 at a time and at most
    /// [`SweepReader::MAX_RETURNS`] in all. `None`: the recording has ended.
    pub fn next_sweep(&mut self, mut sink: impl FnMut(&[LidarReturn])) -> Result<Option<SweepInfo>, SweepError> {
        let mut revolution: Option<Revolution> = None;
        let mut lost_packets = 0;
        let end = loop {
            if self.at.packet.is_none_or(|place| place.block == BLOCKS_PER_PACKET) {
                match self.next_packet()? {
                    None => break None,
                    Some(n_lost) => lost_packets += n_lost,
                }
            }
            if let Some(end) = self.take_blocks(&mut revolution, &mut sink) {
                break Some(end);
            }
        };
        let Some(revolution) = revolution else { return Ok(None) };
        let block_nanos = i64::from(self.decoder.model().timing().block_nanos);
        let end_nanos = match end {
            Some((End::Wrapped, at)) => at,
            Some((End::Forced, _)) | None => revolution.last() + block_nanos,
        };
        let seq = self.at.seq;
        self.at.seq += 1;
        self.at.stats.forced_ends += u64::from(matches!(end, Some((End::Forced, _))));
        Ok(Some(SweepInfo {
            seq,
            stamp: Stamp(revolution.begin),
            duration_nanos: (end_nanos - revolution.begin).clamp(0, i64::from(u32::MAX)) as u32,
            n_returns: revolution.n_returns,
            lost_packets,
            turn: revolution.share(),
        }))
    }

    /// Takes the packet's next blocks into the revolution, up to the packet's end or to the block that ends the revolution.
    fn take_blocks(
        &mut self,
        revolution: &mut Option<Revolution>,
        sink: &mut impl FnMut(&[LidarReturn]),
    ) -> Option<(End, i64)> {
        let packet = DataPacket::new(&self.bytes)?;
        let place = self.at.packet.as_mut()?;
        let block_nanos = i64::from(self.decoder.model().timing().block_nanos);
        let first = place.block;
        let mut end = None;
        while place.block < BLOCKS_PER_PACKET {
            if let Some(azimuth) = packet.azimuth(place.block) {
                let at = place.stamp.0 + i64::from(self.slots[place.block]) * block_nanos;
                let taken = revolution.get_or_insert_with(|| Revolution::begin(at, azimuth)).take(at, azimuth);
                if let Err(reason) = taken {
                    end = Some((reason, at));
                    break;
                }
            }
            place.block += 1;
        }
        if let Some(revolution) = revolution {
            let packet_nanos = place.stamp.0 - revolution.begin;
            self.decoder.decode(packet, first..place.block, packet_nanos, &mut self.scratch);
            revolution.n_returns += self.scratch.len;
            sink(&self.scratch.returns[..self.scratch.len]);
        }
        end
    }

    /// Reads on to the next data packet and gives the number of those missing before it.
    fn next_packet(&mut self) -> Result<Option<u64>, SweepError> {
        while !self.at.ended {
            let Some(arrival) = self.captures.next(&mut self.at.stats)? else {
                self.at.ended = true;
                break;
            };
            if let Some(n_lost) = self.accept(arrival) {
                return Ok(Some(n_lost));
            }
        }
        Ok(None)
    }

    /// Takes the captured packet as the current one, or counts why not.
    fn accept(&mut self, arrival: Arrival) -> Option<u64> {
        let (payload, stats) = (self.captures.payload(), &mut self.at.stats);
        let own_port = arrival.port == self.port || arrival.port == DATA_PORT || arrival.port == POSITION_PORT;
        if own_port && (arrival.is_cut || payload.len() < super::POSITION_PACKET_BYTES) {
            stats.short_packets += 1;
            return None;
        }
        if PositionPacket::new(payload).is_some() {
            stats.position_packets += 1;
            return None;
        }
        let packet = DataPacket::new(payload).filter(|packet| self.decoder.model().may_have_sent(*packet));
        let Some(packet) = packet.filter(|_| arrival.port == self.port) else {
            let is_short = own_port && payload.len() < DATA_PACKET_BYTES;
            *(if is_short { &mut stats.short_packets } else { &mut stats.foreign_packets }) += 1;
            return None;
        };
        if self.at.packet.is_some() && *packet.bytes() == self.bytes {
            stats.duplicated_packets += 1;
            return None;
        }
        let mut n_lost = 0;
        let stamp = match self.at.clock.step(packet.micros(), arrival.captured) {
            Step::Late => {
                stats.late_packets += 1;
                return None;
            }
            Step::Repeated { stamp } => stamp,
            Step::Forward { stamp, nanos } => {
                let slots = i64::from(self.slots[BLOCKS_PER_PACKET - 1]) + 1;
                let packet_nanos = slots * i64::from(self.decoder.model().timing().block_nanos);
                n_lost =
                    if self.at.clock.is_regular() { ((nanos + packet_nanos / 2) / packet_nanos - 1).max(0) } else { 0 };
                stamp
            }
            Step::Jump { stamp } => {
                stats.clock_jumps += 1;
                stamp
            }
        };
        stats.data_packets += 1;
        stats.lost_packets += n_lost as u64;
        stats.bad_blocks += (0..BLOCKS_PER_PACKET).filter(|index| packet.azimuth(*index).is_none()).count() as u64;
        self.slots = self.decoder.slots(packet);
        self.bytes = *packet.bytes();
        self.at.packet = Some(PacketPlace { file: arrival.file, offset: arrival.offset, stamp, block: 0 });
        Some(n_lost as u64)
    }
}
