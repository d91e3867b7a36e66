//! Reads UDP packets from a capture.

use super::blocks::{Next, Record, Records};
use super::fragments::Fragments;
use super::link::{Udp, datagram, udp};
use super::recorder::Reach;
use super::{Frontier, PcapError};
use geometry::Stamp;
use std::net::SocketAddrV4;
use std::path::Path;

/// One UDP packet.
#[derive(Clone, Copy, Debug)]
pub struct UdpPacket<'a> {
    /// Capture time by the clock of the capturing machine.
    pub stamp: Stamp,
    /// Address and port of the sender.
    pub source: SocketAddrV4,
    /// Port of the receiver.
    pub port: u16,
    /// Payload.
    pub payload: &'a [u8],
    /// Whether the capture contains only a part of the payload.
    pub is_cut: bool,
    /// Offset of its record in the file; of its last fragment, if it was sent in fragments.
    pub offset: u64,
    /// Offset from which [`PacketReader::open_at`] reads this packet and all later ones. Differs from `offset` if
    /// fragments of these packets came earlier.
    pub begin: u64,
}

/// Counters of a capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadStats {
    /// Frames that are neither complete UDP packets over IPv4 nor fragments of one.
    pub foreign_frames: u64,
    /// 1 if the file ends inside a record.
    pub cut_records: u64,
    /// End of the last complete record of such a file.
    pub whole_bytes: u64,
}

/// Reads a capture sequentially. Memory: one packet, and up to eight of which fragments are missing.
#[derive(Debug)]
pub struct PacketReader {
    records: Records,
    fragments: Fragments,
    stats: ReadStats,
    ended: bool,
    /// Readable part of a capture that is being written.
    frontier: Option<Frontier>,
    waiting: bool,
}

impl PacketReader {
    /// Opens a capture.
    pub fn open(path: &Path) -> Result<Self, PcapError> {
        let records = Records::open(path)?;
        let fragments = Fragments::default();
        let stats = ReadStats::default();
        Ok(Self { records, fragments, stats, ended: false, frontier: None, waiting: false })
    }

    /// Opens a capture that is being written. [`PacketReader::next`] returns `None` while no more packets are written and can be called
    /// again, see [`PacketReader::is_waiting`].
    pub fn follow(path: &Path, frontier: Frontier) -> Result<Self, PcapError> {
        Ok(Self { frontier: Some(frontier), ..Self::open(path)? })
    }

    /// Opens a capture at the record with this [`UdpPacket::begin`].
    pub fn open_at(path: &Path, offset: u64) -> Result<Self, PcapError> {
        let mut reader = Self::open(path)?;
        reader.records.seek(offset)?;
        Ok(reader)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.records.path()
    }

    /// Whether the last `None` was temporary, because the capture is still being written.
    pub fn is_waiting(&self) -> bool {
        self.waiting
    }

    /// Counters of skipped data so far.
    pub fn stats(&self) -> ReadStats {
        self.stats
    }

    /// The next packet. Nothing follows after an error: if the length of a record is damaged, the next record cannot be found.
    #[expect(
        clippy::should_implement_trait,
        reason = "the packet borrows the reader's buffer, which Iterator does not allow"
    )]
    pub fn next(&mut self) -> Result<Option<UdpPacket<'_>>, PcapError> {
        while !self.ended {
            let reach = self.frontier.as_ref().map(|frontier| frontier.reach(self.records.offset()));
            self.waiting = reach == Some(Reach::NotYet);
            if self.waiting {
                return Ok(None);
            }
            let next = self.records.next();
            self.ended = !matches!(next, Ok(Next::Record(_)));
            match next? {
                Next::End => self.stats.foreign_frames += self.fragments.drop_all(),
                Next::Cut => {
                    self.stats.cut_records = 1;
                    self.stats.whole_bytes = self.records.offset();
                    self.stats.foreign_frames += self.fragments.drop_all();
                }
                Next::Record(record) => {
                    self.stats.foreign_frames += self.fragments.drop_old(record.offset);
                    let Some(begin) = self.begin_of_packet(record) else { continue };
                    // The returned packet borrows the buffers, so it is found again.
                    let found = match udp(record.link, self.records.frame()) {
                        Some(Udp::Whole(datagram)) => Some(datagram),
                        Some(Udp::Fragment(fragment)) => datagram(fragment.addresses(), self.fragments.whole()),
                        None => None,
                    };
                    return Ok(found.map(|found| UdpPacket {
                        stamp: record.stamp,
                        source: found.source,
                        port: found.port,
                        payload: found.payload,
                        is_cut: found.is_cut,
                        offset: record.offset,
                        begin,
                    }));
                }
            }
        }
        Ok(None)
    }

    /// Takes the frame of a record. `None` unless it is a UDP packet or completes one; see [`UdpPacket::begin`].
    fn begin_of_packet(&mut self, record: Record) -> Option<u64> {
        let begin = match udp(record.link, self.records.frame()) {
            Some(Udp::Whole(_)) => Some(record.offset),
            Some(Udp::Fragment(fragment)) => {
                let added = self.fragments.add(&fragment, record.offset);
                self.stats.foreign_frames += added.dropped;
                let begin = added.whole?;
                datagram(fragment.addresses(), self.fragments.whole()).map(|_| begin)
            }
            None => None,
        };
        self.stats.foreign_frames += u64::from(begin.is_none());
        let begin = begin?;
        Some(self.fragments.begin().map_or(begin, |oldest| oldest.min(begin)))
    }
}
