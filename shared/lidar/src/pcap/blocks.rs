//! Records of a capture of either format: stamp, link type and captured bytes.

use super::{Compression, Damage, PcapError};
use files::regular_file;
use geometry::Stamp;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Longest frame, bytes: the limit of libpcap. Longer frames count as damage.
pub(super) const MAX_FRAME: u32 = 256 * 1024;
/// Most interfaces of a section.
pub(super) const MAX_INTERFACES: usize = 256;

const SECTION: u32 = 0x0a0d_0d0a;
const INTERFACE: u32 = 1;
const OLD_PACKET: u32 = 2;
const SIMPLE_PACKET: u32 = 3;
const PACKET: u32 = 6;
const BYTE_ORDER_MAGIC: u32 = 0x1a2b_3c4d;

/// One captured frame. Its bytes are in [`Records::frame`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    /// Offset of the record in the file.
    pub(super) offset: u64,
    pub(super) stamp: Stamp,
    /// Link type, see `https://www.tcpdump.org/linktypes.html`.
    pub(super) link: u32,
}

/// Result of reading the next record.
pub(super) enum Next {
    Record(Record),
    /// The file ends.
    End,
    /// The file ends inside a record.
    Cut,
}

#[derive(Clone, Debug)]
pub(super) enum Format {
    Classic { link: u32, fraction_nanos: i64 },
    Ng { interfaces: Vec<Interface>, last_stamp: Stamp },
}

impl Format {
    /// The format of a file that begins with these bytes.
    pub(super) fn from_magic(magic: [u8; 4]) -> Option<Self> {
        match u32::from_le_bytes(magic) {
            0xa1b2_c3d4 | 0xd4c3_b2a1 => Some(Self::Classic { link: 0, fraction_nanos: 1000 }),
            0xa1b2_3c4d | 0x4d3c_b2a1 => Some(Self::Classic { link: 0, fraction_nanos: 1 }),
            SECTION => Some(Self::Ng { interfaces: Vec::new(), last_stamp: Stamp(0) }),
            _ => None,
        }
    }
}

/// Clock of an interface of a pcapng section.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interface {
    link: u32,
    ticks_per_second: u64,
    offset_seconds: i64,
}

/// Reads records in order.
#[derive(Debug)]
pub(super) struct Records {
    path: PathBuf,
    file: BufReader<File>,
    offset: u64,
    big_endian: bool,
    format: Format,
    frame: Vec<u8>,
}

/// Error of reading a record.
enum ReadFault {
    Cut,
    Io(io::Error),
    Damage(Damage),
}

impl From<io::Error> for ReadFault {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::UnexpectedEof { ReadFault::Cut } else { ReadFault::Io(error) }
    }
}

impl Records {
    pub(super) fn open(path: &Path) -> Result<Self, PcapError> {
        let io = |cause| PcapError::Io { path: path.to_owned(), cause };
        // A buffer holds about 200 packets.
        let mut file = BufReader::with_capacity(256 * 1024, regular_file::open(path).map_err(io)?);
        let mut magic = [0; 4];
        let damaged = |damage| PcapError::Damaged { path: path.to_owned(), offset: 0, damage };
        file.read_exact(&mut magic).map_err(|_| damaged(Damage::NoHeader))?;
        let Some(format) = Format::from_magic(magic) else {
            let number = u32::from_le_bytes(magic);
            return Err(damaged(match Compression::from_magic(magic) {
                Some(compression) => Damage::Compressed(compression),
                // Of patched versions of libpcap.
                None if matches!(number, 0xa1b2_cd34 | 0x34cd_b2a1 | 0xa1b2_34cd | 0xcd34_b2a1) => {
                    Damage::Variant(number)
                }
                None => Damage::Magic(number),
            }));
        };
        // Of a classic capture; a section of pcapng has its own mark.
        let big_endian = magic[0] == 0xa1;
        let mut records = Self { path: path.to_owned(), file, offset: 4, big_endian, format, frame: Vec::new() };
        match &records.format {
            Format::Classic { .. } => {
                let mut header = [0; 20];
                records.file.read_exact(&mut header).map_err(|_| damaged(Damage::CutHeader))?;
                records.offset = 24;
                // The upper bits describe frame check sequences.
                let link_type = records.u32_at(&header, 16) & 0x0fff_ffff;
                if let Format::Classic { link, .. } = &mut records.format {
                    *link = link_type;
                }
            }
            Format::Ng { .. } => {
                records.file.rewind().map_err(io)?;
                records.offset = 0;
            }
        }
        Ok(records)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether a classic pcap is big-endian, and the unit of its fractions of a second, ns; `None` for pcapng.
    pub(super) fn classic(&self) -> Option<(bool, i64)> {
        match self.format {
            Format::Classic { fraction_nanos, .. } => Some((self.big_endian, fraction_nanos)),
            Format::Ng { .. } => None,
        }
    }

    /// Offset of the next record.
    pub(super) fn offset(&self) -> u64 {
        self.offset
    }

    pub(super) fn frame(&self) -> &[u8] {
        &self.frame
    }

    /// Continues at a record by its offset. Nothing may have been read before.
    pub(super) fn seek(&mut self, offset: u64) -> Result<(), PcapError> {
        if matches!(self.format, Format::Ng { .. }) {
            // Interfaces are declared before the record, so all blocks before it must be read. Blocks of other kinds may stand right
            // before the record, which must not be read with them.
            while self.offset < offset && matches!(self.next_before(offset)?, Next::Record(_)) {}
            return Ok(());
        }
        let sought = self.file.seek(SeekFrom::Start(offset));
        sought.map_err(|cause| PcapError::Io { path: self.path.clone(), cause })?;
        self.offset = offset;
        Ok(())
    }

    pub(super) fn next(&mut self) -> Result<Next, PcapError> {
        self.next_before(u64::MAX)
    }

    /// The next record. In pcapng, no block that begins at `end` or later is read.
    fn next_before(&mut self, end: u64) -> Result<Next, PcapError> {
        let start = self.offset;
        let read = match self.format {
            Format::Classic { link, fraction_nanos } => self.next_classic(link, fraction_nanos),
            Format::Ng { .. } => self.next_ng(end),
        };
        match read {
            Ok(Some(record)) => Ok(Next::Record(record)),
            Ok(None) => Ok(Next::End),
            Err(ReadFault::Cut) => Ok(Next::Cut),
            Err(ReadFault::Io(cause)) => Err(PcapError::Io { path: self.path.clone(), cause }),
            Err(ReadFault::Damage(damage)) => {
                Err(PcapError::Damaged { path: self.path.clone(), offset: start, damage })
            }
        }
    }

    fn next_classic(&mut self, link: u32, fraction_nanos: i64) -> Result<Option<Record>, ReadFault> {
        let Some(header) = self.head::<16>()? else { return Ok(None) };
        let [seconds, fraction, captured, wire] = [0, 4, 8, 12].map(|at| self.u32_at(&header, at));
        let fraction = i64::from(fraction) * fraction_nanos;
        if captured > MAX_FRAME || fraction >= 1_000_000_000 {
            let damage = Damage::Record { captured, wire, seconds, fraction_nanos: fraction };
            return Err(ReadFault::Damage(damage));
        }
        self.read_frame(captured)?;
        let record = Record { offset: self.offset, stamp: Stamp(i64::from(seconds) * 1_000_000_000 + fraction), link };
        self.offset += 16 + u64::from(captured);
        Ok(Some(record))
    }

    fn next_ng(&mut self, end: u64) -> Result<Option<Record>, ReadFault> {
        while self.offset < end {
            let Some(head) = self.head::<12>()? else { return Ok(None) };
            if head[..4] == SECTION.to_le_bytes() {
                self.begin_section(&head)?;
            }
            let kind = self.u32_at(&head, 0);
            let total = self.u32_at(&head, 4);
            if total < 12 || !total.is_multiple_of(4) {
                return Err(ReadFault::Damage(Damage::BlockLength(total)));
            }
            let start = self.offset;
            if matches!(kind, INTERFACE | OLD_PACKET | SIMPLE_PACKET | PACKET) {
                let rest = total - 12;
                if rest > MAX_FRAME + 1024 {
                    return Err(ReadFault::Damage(Damage::PacketBlock(total)));
                }
                self.read_frame(rest)?;
                // The frame now ends with the length of the block. The first word of the block is in `head`.
                let first_word = self.u32_at(&head, 8);
                self.offset += u64::from(total);
                if let Some((stamp, link)) = self.packet_block(kind, first_word)? {
                    return Ok(Some(Record { offset: start, stamp, link }));
                }
            } else {
                self.file.seek_relative(i64::from(total) - 12)?;
                self.offset += u64::from(total);
            }
        }
        Ok(None)
    }

    fn begin_section(&mut self, head: &[u8; 12]) -> Result<(), ReadFault> {
        self.big_endian = match u32::from_le_bytes([head[8], head[9], head[10], head[11]]) {
            BYTE_ORDER_MAGIC => false,
            magic if magic.swap_bytes() == BYTE_ORDER_MAGIC => true,
            other => return Err(ReadFault::Damage(Damage::ByteOrder(other))),
        };
        if let Format::Ng { interfaces, .. } = &mut self.format {
            interfaces.clear();
        }
        Ok(())
    }

    /// Stamp and link type of a packet block; leaves its captured bytes in the frame. `None` for an interface block.
    fn packet_block(&mut self, kind: u32, first_word: u32) -> Result<Option<(Stamp, u32)>, ReadFault> {
        let words: [u32; 4] =
            std::array::from_fn(|i| if self.frame.len() >= i * 4 + 4 { self.u32_at(&self.frame, i * 4) } else { 0 });
        let big_endian = self.big_endian;
        let n_bytes = self.frame.len();
        let Format::Ng { interfaces, last_stamp } = &mut self.format else { return Ok(None) };
        if kind == INTERFACE {
            if interfaces.len() == MAX_INTERFACES {
                return Err(ReadFault::Damage(Damage::Interfaces));
            }
            interfaces.push(Interface::new(first_word, &self.frame, big_endian));
            return Ok(None);
        }
        let (index, header, captured) = match kind {
            // Interface and drop count share the first word.
            OLD_PACKET => (if big_endian { first_word >> 16 } else { first_word & 0xffff }, 16, words[2]),
            SIMPLE_PACKET => (0, 0, first_word),
            _ => (first_word, 16, words[2]),
        };
        let Some(interface) = interfaces.get(index as usize) else {
            let damage = Damage::Interface { index, n_declared: interfaces.len() };
            return Err(ReadFault::Damage(damage));
        };
        if kind != SIMPLE_PACKET {
            *last_stamp = interface.stamp(u64::from(words[0]) << 32 | u64::from(words[1]));
        }
        let stamp = *last_stamp;
        let link = interface.link;
        // A simple packet may be shorter than its length on the wire; its block then ends earlier.
        let room = n_bytes.saturating_sub(header + 4);
        let captured = captured as usize;
        if captured > room && kind != SIMPLE_PACKET {
            return Err(ReadFault::Damage(Damage::PacketLength { captured, room }));
        }
        self.frame.truncate(header + captured.min(room));
        self.frame.drain(..header.min(self.frame.len()));
        Ok(Some((stamp, link)))
    }

    /// The next `N` bytes; `None` at the end of the file.
    fn head<const N: usize>(&mut self) -> Result<Option<[u8; N]>, ReadFault> {
        let mut head = [0; N];
        let mut n_read = 0;
        while n_read < N {
            match self.file.read(&mut head[n_read..]) {
                Ok(0) if n_read == 0 => return Ok(None),
                Ok(0) => return Err(ReadFault::Cut),
                Ok(n) => n_read += n,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(ReadFault::Io(error)),
            }
        }
        Ok(Some(head))
    }

    fn read_frame(&mut self, length: u32) -> Result<(), ReadFault> {
        self.frame.resize(length as usize, 0);
        Ok(self.file.read_exact(&mut self.frame)?)
    }

    fn u32_at(&self, bytes: &[u8], at: usize) -> u32 {
        let word = [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        if self.big_endian { u32::from_be_bytes(word) } else { u32::from_le_bytes(word) }
    }
}

impl Interface {
    /// Clock from the first word of an interface block and the rest of the block (snap length, options, length of the
    /// block).
    fn new(first_word: u32, rest: &[u8], big_endian: bool) -> Self {
        let u16_of = |b: [u8; 2]| if big_endian { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) };
        let link = if big_endian { first_word >> 16 } else { first_word & 0xffff };
        let mut interface = Self { link, ticks_per_second: 1_000_000, offset_seconds: 0 };
        let mut options = rest.get(4..rest.len().saturating_sub(4)).unwrap_or_default();
        while let Some((head, tail)) = options.split_first_chunk::<4>() {
            let code = u16_of([head[0], head[1]]);
            let length = usize::from(u16_of([head[2], head[3]]));
            let Some(value) = tail.get(..length) else { break };
            match (code, value) {
                (0, _) => break,
                (9, [resolution]) => interface.ticks_per_second = ticks_per_second(*resolution),
                (14, value) => {
                    if let Some(bytes) = value.first_chunk::<8>() {
                        let seconds = if big_endian { i64::from_be_bytes(*bytes) } else { i64::from_le_bytes(*bytes) };
                        interface.offset_seconds = seconds;
                    }
                }
                _ => {}
            }
            options = tail.get(length.next_multiple_of(4)..).unwrap_or_default();
        }
        interface
    }

    fn stamp(&self, ticks: u64) -> Stamp {
        let nanos = i128::from(ticks) * 1_000_000_000 / i128::from(self.ticks_per_second);
        let nanos = nanos + i128::from(self.offset_seconds) * 1_000_000_000;
        // Times are limited to 1970 to 2200.
        Stamp(nanos.clamp(0, 7_258_118_400_000_000_000) as i64)
    }
}

/// Option `if_tsresol`: a power of ten, or of two if the highest bit is set. Unsupported powers are read as nanoseconds.
fn ticks_per_second(resolution: u8) -> u64 {
    let exponent = u32::from(resolution & 0x7f);
    let base: u64 = if resolution & 0x80 == 0 { 10 } else { 2 };
    base.checked_pow(exponent).unwrap_or(1_000_000_000)
}
