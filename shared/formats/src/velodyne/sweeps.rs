//! Captures into sweeps, one after the other, in bounded memory.

use super::capture::{Arrival, Captures};
use super::clock::{Clock, Step};
use super::decode::{Decoder, LidarReturn, Scratch};
use super::packet::{
    BLOCKS_PER_PACKET, DATA_PACKET_BYTES, DATA_PORT, DataPacket, MAX_RETURNS_PER_PACKET, POSITION_PORT,
};
use super::revolutions::{End, MAX_RETURNS, Revolution};
use super::sentences::Sentences;
use super::survey::{Look, Survey, survey};
use super::{LidarStats, Model, PositionPacket};
use crate::nmea::{Fix, LogStats};
use crate::pcap::{Frontier, PcapError};
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
    #[error("{path}: no data packet of {wanted} in the first 4096 UDP packets{damage}", path = path.display())]
    NoSensor {
        /// The first capture.
        path: PathBuf,
        /// The models that would do.
        wanted: String,
        /// What is wrong with damaged captures, `; ` before each.
        damage: String,
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

/// What [`SweepReader::poll_sweep`] came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SweepPoll {
    /// The sweep is complete.
    Sweep(SweepInfo),
    /// The recording is still being written, and the sweep is not complete.
    Pending,
    /// The recording has ended.
    End,
}

/// A place between two sweeps, from which reading can go on ([`SweepReader::resume`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SweepPosition {
    seq: u64,
    clock: Clock,
    stats: LidarStats,
    sentences: Sentences,
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
    /// The sweep under way, and the packets missing in it so far.
    revolution: Option<Revolution>,
    lost_packets: u64,
    fixes: Vec<Fix>,
}

impl SweepReader {
    /// The most returns that a sweep can have.
    pub const MAX_RETURNS: usize = MAX_RETURNS + MAX_RETURNS_PER_PACKET;

    /// Looks at the beginning of the captures, which are one recording cut into files. Without a model, the first data
    /// packet tells.
    pub fn open(files: Vec<PathBuf>, model: Option<Model>) -> Result<Self, SweepError> {
        match survey(Captures::new(files.clone()), model)? {
            Look::Settled(survey) => Ok(Self::with_survey(Captures::new(files), &survey)),
            Look::NoSensor(damage) => Err(no_sensor(files, model, &damage)),
            Look::TooEarly => Err(no_sensor(files, model, &[])),
        }
    }

    /// Reads a recording's last file while it is being written. The files before it, of the same recording, are looked at
    /// for what [`SweepReader::open`] would find in them, and passed over. `None`: what the recording's beginning says is
    /// not settled yet (4096 packets, or fewer with a position fix among them); ask again when there is more.
    pub fn follow(files: Vec<PathBuf>, frontier: &Frontier, model: Option<Model>) -> Result<Option<Self>, SweepError> {
        let captures = || Captures::follow(files.clone(), frontier.clone());
        let mut look = survey(captures(), model)?;
        if let (Look::Settled(first), None) = (&look, model) {
            // Whoever opens the recording later knows the model, and with it looks at packets that do not name theirs.
            look = survey(captures(), Some(first.model))?;
        }
        match look {
            Look::Settled(survey) => {
                let mut captures = captures();
                captures.skip_to_last();
                Ok(Some(Self::with_survey(captures, &survey)))
            }
            Look::TooEarly => Ok(None),
            Look::NoSensor(damage) => Err(no_sensor(files, model, &damage)),
        }
    }

    fn with_survey(captures: Captures, survey: &Survey) -> Self {
        let (stats, sentences) = (LidarStats::default(), Sentences::default());
        Self {
            captures,
            decoder: Decoder::new(survey.model),
            port: survey.port,
            at: SweepPosition { seq: 0, clock: survey.clock, stats, sentences, packet: None, ended: false },
            bytes: [0; DATA_PACKET_BYTES],
            slots: [0; BLOCKS_PER_PACKET],
            scratch: Box::default(),
            revolution: None,
            lost_packets: 0,
            fixes: Vec::new(),
        }
    }

    /// Goes to a place that [`SweepReader::position`] gave for the same captures.
    pub fn resume(&mut self, position: SweepPosition) -> Result<(), SweepError> {
        self.at = position;
        (self.revolution, self.lost_packets) = (None, 0);
        self.fixes.clear();
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

    /// The fixes of the position packets that were read since the last call. A fix is known when the receiver's next
    /// sentence, or the recording's end, has been read.
    pub fn take_fixes(&mut self) -> Vec<Fix> {
        std::mem::take(&mut self.fixes)
    }

    /// Counts of the position packets' sentences since the start of the recording.
    pub fn log_stats(&self) -> LogStats {
        self.at.sentences.stats()
    }

    /// Hands the returns of the next sweep to `sink`, in the order of firing, at most 384 at a time and at most
    /// [`SweepReader::MAX_RETURNS`] in all. `None`: the recording has ended, or there is no more of it yet.
    pub fn next_sweep(&mut self, sink: impl FnMut(&[LidarReturn])) -> Result<Option<SweepInfo>, SweepError> {
        match self.poll_sweep(sink)? {
            SweepPoll::Sweep(info) => Ok(Some(info)),
            SweepPoll::Pending | SweepPoll::End => Ok(None),
        }
    }

    /// As [`SweepReader::next_sweep`], of a recording that is being written: after [`SweepPoll::Pending`] the next call
    /// goes on in the same sweep, and hands over those returns that have come since.
    pub fn poll_sweep(&mut self, mut sink: impl FnMut(&[LidarReturn])) -> Result<SweepPoll, SweepError> {
        let mut revolution = self.revolution.take();
        let end = loop {
            if self.at.packet.is_none_or(|place| place.block == BLOCKS_PER_PACKET) {
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
        let block_nanos = i64::from(self.decoder.model().timing().block_nanos);
        let end_nanos = match end {
            Some((End::Wrapped, at)) => at,
            Some((End::Forced, _)) | None => revolution.last() + block_nanos,
        };
        let seq = self.at.seq;
        self.at.seq += 1;
        self.at.stats.forced_ends += u64::from(matches!(end, Some((End::Forced, _))));
        Ok(SweepPoll::Sweep(SweepInfo {
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

    /// Reads on to the next data packet and gives the number of those missing before it. `None`: there is none, or none yet.
    fn next_packet(&mut self) -> Result<Option<u64>, SweepError> {
        while !self.at.ended {
            let Some(arrival) = self.captures.next(&mut self.at.stats)? else {
                if !self.captures.is_waiting() {
                    self.at.ended = true;
                    self.fixes.extend(self.at.sentences.finish());
                }
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
        if let Some(packet) = PositionPacket::new(payload) {
            stats.position_packets += 1;
            self.fixes.extend(self.at.sentences.take(packet.nmea));
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
                let slots = i64::from(self.decoder.n_slots(self.slots));
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

fn no_sensor(files: Vec<PathBuf>, model: Option<Model>, damage: &[String]) -> SweepError {
    let wanted = model.map_or_else(|| Model::ALL.map(Model::name).join(", "), |model| model.name().to_owned());
    let damage = damage.iter().flat_map(|text| ["; ", text]).collect();
    SweepError::NoSensor { path: files.into_iter().next().unwrap_or_default(), wanted, damage }
}
