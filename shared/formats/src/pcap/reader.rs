//! UDP packets out of a capture.

use super::blocks::{Next, Records};
use super::link::datagram;
use super::recorder::Reach;
use super::{Frontier, PcapError};
use geometry::Stamp;
use std::path::Path;

/// One UDP packet.
#[derive(Clone, Copy, Debug)]
pub struct UdpPacket<'a> {
    /// When the capturing machine saw it, by that machine's clock.
    pub stamp: Stamp,
    /// Of the sender.
    pub source_port: u16,
    /// Of the receiver.
    pub port: u16,
    /// What it carries.
    pub payload: &'a [u8],
    /// The capture was limited to fewer bytes than the packet had.
    pub is_cut: bool,
    /// Where its record starts in the file; see [`PacketReader::open_at`].
    pub offset: u64,
}

/// What else is in a capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadStats {
    /// Frames that are no whole UDP packet over IPv4.
    pub foreign_frames: u64,
    /// 1 if the file ends within a record.
    pub cut_records: u64,
}

/// Reads a capture from its beginning to its end, holding one packet at a time.
#[derive(Debug)]
pub struct PacketReader {
    records: Records,
    stats: ReadStats,
    ended: bool,
    /// Of a capture that is being written.
    frontier: Option<Frontier>,
    waiting: bool,
}

impl PacketReader {
    /// Opens a capture.
    pub fn open(path: &Path) -> Result<Self, PcapError> {
        let records = Records::open(path)?;
        Ok(Self { records, stats: ReadStats::default(), ended: false, frontier: None, waiting: false })
    }

    /// Opens a capture that is being written. Where nothing more has been written yet, [`PacketReader::next`] gives `None`
    /// and may be asked again, see [`PacketReader::is_waiting`].
    pub fn follow(path: &Path, frontier: Frontier) -> Result<Self, PcapError> {
        Ok(Self { frontier: Some(frontier), ..Self::open(path)? })
    }

    /// Opens a capture at a record whose [`UdpPacket::offset`] is known.
    pub fn open_at(path: &Path, offset: u64) -> Result<Self, PcapError> {
        let mut reader = Self::open(path)?;
        reader.records.seek(offset)?;
        Ok(reader)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.records.path()
    }

    /// Whether the last `None` was for now only: the capture is still being written.
    pub fn is_waiting(&self) -> bool {
        self.waiting
    }

    /// What was passed over so far.
    pub fn stats(&self) -> ReadStats {
        self.stats
    }

    /// The next packet. After `None` or an error there is nothing more: where a record's length is damaged, nobody knows
    /// where the next one starts.
    #[expect(
        clippy::should_implement_trait,
        reason = "the packet borrows the reader's buffer, which Iterator cannot say"
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
                Next::End => {}
                Next::Cut => self.stats.cut_records += 1,
                Next::Record(record) => {
                    if datagram(record.link, self.records.frame()).is_none() {
                        self.stats.foreign_frames += 1;
                        continue;
                    }
                    let found = datagram(record.link, self.records.frame());
                    return Ok(found.map(|datagram| UdpPacket {
                        stamp: record.stamp,
                        source_port: datagram.source_port,
                        port: datagram.port,
                        payload: datagram.payload,
                        is_cut: datagram.is_cut,
                        offset: record.offset,
                    }));
                }
            }
        }
        Ok(None)
    }
}
