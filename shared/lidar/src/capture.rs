//! Several captures read as one stream. Recorders start a new file every few minutes.

use super::LidarStats;
use crate::pcap::{Frontier, PacketReader, PcapError, ReadStats, UdpPacket};
use geometry::Stamp;
use std::net::SocketAddrV4;
use std::path::PathBuf;

/// A packet of the stream. Its payload is in [`Captures::payload`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival {
    pub(super) captured: Stamp,
    /// Address and port of the sender.
    pub(super) source: SocketAddrV4,
    pub(super) port: u16,
    pub(super) is_cut: bool,
    /// Index of the file.
    pub(super) file: usize,
    /// Offset of its record in the file.
    pub(super) offset: u64,
    /// Offset from which the file must be read to get the packet.
    pub(super) begin: u64,
}

/// Reads files in order.
#[derive(Debug)]
pub(super) struct Captures {
    files: Vec<PathBuf>,
    /// Index of the file that is open or opened next.
    file: usize,
    reader: Option<PacketReader>,
    /// Counters of the reader that were already added to the counters of the stream.
    counted: ReadStats,
    payload: Vec<u8>,
    /// Errors of damaged captures.
    damage: Vec<String>,
    /// Readable part of the last file, if it is being written.
    frontier: Option<Frontier>,
}

impl Captures {
    pub(super) fn new(files: Vec<PathBuf>) -> Self {
        Self {
            files,
            file: 0,
            reader: None,
            counted: ReadStats::default(),
            payload: Vec::new(),
            damage: Vec::new(),
            frontier: None,
        }
    }

    /// Like [`Captures::new`], with a last file that is being written.
    pub(super) fn follow(files: Vec<PathBuf>, frontier: Frontier) -> Self {
        Self { frontier: Some(frontier), ..Self::new(files) }
    }

    /// Skips all files but the last.
    pub(super) fn skip_to_last(&mut self) {
        self.file = self.files.len().saturating_sub(1);
    }

    /// Whether the last `None` was temporary.
    pub(super) fn is_waiting(&self) -> bool {
        self.reader.as_ref().is_some_and(PacketReader::is_waiting)
    }

    /// Continues at a record.
    pub(super) fn seek(&mut self, file: usize, offset: u64) -> Result<(), PcapError> {
        self.file = file;
        self.counted = ReadStats::default();
        self.reader = match self.files.get(file) {
            Some(path) => Some(PacketReader::open_at(path, offset)?),
            None => None,
        };
        Ok(())
    }

    pub(super) fn files(&self) -> &[PathBuf] {
        &self.files
    }

    pub(super) fn payload(&self) -> &[u8] {
        &self.payload
    }

    /// Errors of damaged captures, one text per capture.
    pub(super) fn damage(&self) -> &[String] {
        &self.damage
    }

    /// The next packet. Damaged captures are counted and skipped. Only errors of the operating system are returned.
    pub(super) fn next(&mut self, stats: &mut LidarStats) -> Result<Option<Arrival>, PcapError> {
        loop {
            match self.next_of_file(stats) {
                Ok(Some(arrival)) => return Ok(Some(arrival)),
                Ok(None) if self.is_waiting() => return Ok(None),
                Ok(None) => {}
                Err(error @ PcapError::Io { .. }) => return Err(error),
                Err(error @ PcapError::Damaged { offset, .. }) => {
                    stats.damaged_captures += 1;
                    stats.unread_bytes += self.file_bytes().saturating_sub(offset);
                    self.damage.push(error.to_string());
                }
            }
            if self.file >= self.files.len() {
                return Ok(None);
            }
            self.file += 1;
            self.reader = None;
            self.counted = ReadStats::default();
        }
    }

    /// Size of the current file.
    fn file_bytes(&self) -> u64 {
        let metadata = self.files.get(self.file).and_then(|path| path.metadata().ok());
        metadata.map_or(0, |metadata| metadata.len())
    }

    fn next_of_file(&mut self, stats: &mut LidarStats) -> Result<Option<Arrival>, PcapError> {
        let Some(path) = self.files.get(self.file) else { return Ok(None) };
        let reader = match &mut self.reader {
            Some(reader) => reader,
            empty => {
                let followed = self.frontier.clone().filter(|_| self.file + 1 == self.files.len());
                empty.insert(match followed {
                    Some(frontier) => PacketReader::follow(path, frontier)?,
                    None => PacketReader::open(path)?,
                })
            }
        };
        let arrival = reader.next()?.map(|packet| {
            self.payload.clear();
            self.payload.extend_from_slice(packet.payload);
            let UdpPacket { stamp, source, port, is_cut, offset, begin, .. } = packet;
            Arrival { captured: stamp, source, port, is_cut, file: self.file, offset, begin }
        });
        let now = reader.stats();
        stats.foreign_packets += now.foreign_frames - self.counted.foreign_frames;
        if now.cut_records > self.counted.cut_records {
            stats.cut_captures += 1;
            stats.unread_bytes += self.file_bytes().saturating_sub(now.whole_bytes);
        }
        self.counted = now;
        Ok(arrival)
    }
}
