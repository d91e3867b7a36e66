//! A capture that is read while it is being written.

use super::Writer;
use geometry::Stamp;
use std::fs::File;
use std::io::{self, Write};
use std::net::SocketAddrV4;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Bytes of the file header.
const HEADER: u64 = 24;
/// Size of the write buffer, about 50 packets. A larger buffer is not faster.
const BUFFER: usize = 64 * 1024;

/// Readable part of a growing capture, always up to the end of a packet. Shared by writer and readers.
#[derive(Clone, Debug, Default)]
pub struct Frontier(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    whole_bytes: AtomicU64,
    is_closed: AtomicBool,
}

/// State of a growing capture at an offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// A complete packet follows.
    Packet,
    /// Nothing is written yet.
    NotYet,
    /// The capture ends.
    End,
}

impl Frontier {
    /// Bytes of the file with complete packets.
    pub fn whole_bytes(&self) -> u64 {
        self.0.whole_bytes.load(Ordering::Acquire)
    }

    /// Whether the capture is complete.
    pub fn is_closed(&self) -> bool {
        self.0.is_closed.load(Ordering::Acquire)
    }

    pub(super) fn reach(&self, offset: u64) -> Reach {
        // The flag is read first, so that everything written before the close is included.
        let is_closed = self.is_closed();
        match offset < self.whole_bytes() {
            true => Reach::Packet,
            false if is_closed => Reach::End,
            false => Reach::NotYet,
        }
    }
}

/// Writes a capture for readers that follow it. Complete packets are written in order, at [`Recorder::flush`], when the buffer is full,
/// and at the end. After a crash of the process the capture lacks only the last packets.
///
/// ```
/// use lidar::pcap::{PacketReader, Recorder};
/// use geometry::Stamp;
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("000.pcap");
/// let (sensor, host) = ("192.168.1.201:2368".parse()?, "192.168.1.2:2368".parse()?);
/// let mut recorder = Recorder::create(&path)?;
/// let mut reader = PacketReader::follow(&path, recorder.frontier())?;
/// recorder.write(Stamp(1_600_000_000_000_000_000), sensor, host, &[7; 1206])?;
/// assert!(reader.next()?.is_none() && reader.is_waiting());
/// recorder.flush()?;
/// assert_eq!(reader.next()?.map(|packet| packet.payload[0]), Some(7));
/// drop(recorder);
/// assert!(reader.next()?.is_none() && !reader.is_waiting());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Recorder {
    file: File,
    packets: Writer<Vec<u8>>,
    frontier: Frontier,
    /// Whether a write failed. The file then ends inside a packet, and nothing may follow.
    is_torn: bool,
}

impl Recorder {
    /// Creates the file, which must not exist.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = File::create_new(path)?;
        let mut recorder =
            Self { file, packets: Writer::new(Vec::new())?, frontier: Frontier::default(), is_torn: false };
        recorder.flush()?;
        debug_assert_eq!(recorder.frontier.whole_bytes(), HEADER);
        Ok(recorder)
    }

    /// Readable part of the file.
    pub fn frontier(&self) -> Frontier {
        self.frontier.clone()
    }

    /// Appends a packet received at `stamp` (1970 to 2106, truncated to µs).
    pub fn write(
        &mut self,
        stamp: Stamp,
        source: SocketAddrV4,
        target: SocketAddrV4,
        payload: &[u8],
    ) -> io::Result<()> {
        self.packets.write_datagram(stamp, source, target, payload)?;
        if self.packets.out.len() >= BUFFER { self.flush() } else { Ok(()) }
    }

    /// Whether packets are buffered.
    pub fn has_unwritten(&self) -> bool {
        !self.packets.out.is_empty()
    }

    /// Writes buffered packets to the file. Readers can read them, and they survive a crash of the process.
    pub fn flush(&mut self) -> io::Result<()> {
        if self.is_torn {
            return Err(io::Error::other("an earlier write failed inside a packet; the capture cannot be continued"));
        }
        self.is_torn = true;
        self.file.write_all(&self.packets.out)?;
        self.is_torn = false;
        self.frontier.0.whole_bytes.fetch_add(self.packets.out.len() as u64, Ordering::Release);
        self.packets.out.clear();
        Ok(())
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // Errors are ignored here. Call `flush` before to see them.
        let _ = self.flush();
        self.frontier.0.is_closed.store(true, Ordering::Release);
    }
}
