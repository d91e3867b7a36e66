//! MCAP (<https://mcap.dev/spec>).
//!
//! A file is a magic number, records, and the magic number again. A record is its kind (u8), the length of its body (u64), and the
//! body; all numbers are little-endian. Chunks contain records. The last record, the footer, contains the start of the
//! summary.
//!
//! Not based on the crate mcap, which allocates as much as damaged lengths request, and decompresses with C libraries.

mod body;

use super::decompress::{ContentLimit, decompressed};
use super::record::{AtByte, Checked, Skip, array, array_or_end, read_bytes};
use super::topics::{Encoding, Topics};
use super::{Container, Each, Message};
use crate::error::{At, ImportError};
use body::Body;
use files::regular_file;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

const HEAD_BYTES: u64 = 9;
const FOOTER: u8 = 2;
const FOOTER_BYTES: u64 = 20;
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const STATISTICS: u8 = 11;
const DATA_END: u8 = 15;
/// Bytes of a message before its data.
const MESSAGE_HEAD: u64 = 22;

pub(super) struct Mcap {
    path: PathBuf,
    index: Index,
    /// Start of the footer.
    end: u64,
    /// Time of the first message.
    begin: Option<i64>,
}

/// Channels and their topics.
#[derive(Clone, Default)]
struct Index {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, usize>,
    topics: Topics,
}

impl Mcap {
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        let mut file = BufReader::new(regular_file::open(path).at(path)?);
        let n_bytes = file.get_ref().metadata().at(path)?.len();
        let magic = MAGIC.len() as u64;
        let end = n_bytes.checked_sub(magic + HEAD_BYTES + FOOTER_BYTES).filter(|end| *end >= magic);
        let not_closed =
            || ImportError::at(path, "ends without footer: the recording was not closed; run `mcap recover`");
        let end = end.ok_or_else(not_closed)?;
        file.seek(SeekFrom::Start(end)).at(path)?;
        let mut footer = [0; (HEAD_BYTES + FOOTER_BYTES) as usize];
        let mut tail = [0; MAGIC.len()];
        file.read_exact(&mut footer).at(path)?;
        file.read_exact(&mut tail).at(path)?;
        if tail != *MAGIC || footer[0] != FOOTER {
            return Err(not_closed());
        }
        let summary = Body::new(&footer[HEAD_BYTES as usize..]).u64().at_byte(path, end)?;
        let mut mcap = Self { path: path.to_owned(), index: Index::default(), end, begin: None };
        if summary == 0 || !mcap.read_summary(&mut file, summary)? {
            let mut index = Index::default();
            mcap.begin = mcap.pass(&mut index, &[], &mut |_| Ok(()))?;
            mcap.index = index;
        }
        Ok(mcap)
    }

    /// Reads channels and counts of the summary; `false` if they are incomplete.
    fn read_summary(&mut self, file: &mut BufReader<File>, summary: u64) -> Result<bool, ImportError> {
        if !(MAGIC.len() as u64..=self.end).contains(&summary) {
            let rule = format!("the summary is at byte {summary}; must be before the footer");
            return Err(ImportError::at_part(&self.path, &format!("byte {}", self.end), rule));
        }
        let mut at = summary;
        let mut bytes = Vec::new();
        let mut counts = None;
        file.seek(SeekFrom::Start(at)).at(&self.path)?;
        while at < self.end {
            let (kind, length) = self.head(file, at)?;
            match kind {
                SCHEMA | CHANNEL | STATISTICS => {
                    read_bytes(file, length, &mut bytes).at_byte(&self.path, at)?;
                    let body = Body::new(&bytes);
                    if kind == STATISTICS {
                        let (begin, of_channels) = body.statistics().at_byte(&self.path, at)?;
                        self.begin = begin;
                        counts = Some(of_channels);
                    } else {
                        self.index.add(kind, body).at_byte(&self.path, at)?;
                    }
                }
                _ => file.skip(length).at_byte(&self.path, at)?,
            }
            at += HEAD_BYTES + length;
        }
        let Some(counts) = counts else { return Ok(false) };
        for (channel, n) in counts {
            let Some(topic) = self.index.channels.get(&channel) else { return Ok(false) };
            self.index.topics.count(*topic, n);
        }
        Ok(true)
    }

    /// Kind and length of the record at byte `at`.
    fn head(&self, file: &mut BufReader<File>, at: u64) -> Result<(u8, u64), ImportError> {
        let head: [u8; HEAD_BYTES as usize] = array(file).at_byte(&self.path, at)?;
        let (kind, length) = split(head);
        let left = self.end - at;
        if left < HEAD_BYTES || length > left - HEAD_BYTES {
            let rule = format!("a record of kind {kind:#04x} and {length} bytes; {left} bytes are left");
            return Err(ImportError::at_part(&self.path, &format!("byte {at}"), rule));
        }
        Ok((kind, length))
    }

    /// Reads the complete file. Adds its channels and counts to `index`. Returns the time of the earliest message.
    fn pass(&self, index: &mut Index, wanted: &[Cell<bool>], each: &mut Each<'_>) -> Result<Option<i64>, ImportError> {
        let mut file = BufReader::new(regular_file::open(&self.path).at(&self.path)?);
        let mut at = MAGIC.len() as u64;
        file.seek(SeekFrom::Start(at)).at(&self.path)?;
        let content_limit = ContentLimit::for_file(self.end);
        let mut pass =
            Pass { path: &self.path, at, index, wanted, each, content_limit, bytes: Vec::new(), begin: None };
        while at < self.end {
            let (kind, length) = self.head(&mut file, at)?;
            pass.at = at;
            match kind {
                DATA_END => break,
                CHUNK => pass.chunk(&mut file, length)?,
                _ => pass.record(&mut file, kind, length)?,
            }
            at += HEAD_BYTES + length;
        }
        Ok(pass.begin)
    }
}

/// Kind and length of a record.
fn split(head: [u8; HEAD_BYTES as usize]) -> (u8, u64) {
    let [kind, length @ ..] = head;
    (kind, u64::from_le_bytes(length))
}

impl Container for Mcap {
    fn topics(&self) -> &Topics {
        &self.index.topics
    }

    fn begin(&self) -> Option<i64> {
        self.begin
    }

    fn read(&mut self, wanted: &[Cell<bool>], each: &mut Each<'_>) -> Result<(), ImportError> {
        // The topics keep their order: the channels of the index exist from the start.
        self.pass(&mut self.index.clone(), wanted, each).map(|_| ())
    }
}

impl Index {
    /// Adds a schema or channel.
    fn add(&mut self, kind: u8, mut body: Body<'_>) -> io::Result<()> {
        if kind == SCHEMA {
            let id = body.u16()?;
            let name = body.text()?;
            self.schemas.insert(id, name);
            return Ok(());
        }
        let id = body.u16()?;
        let schema = body.u16()?;
        let topic = body.text()?;
        let encoding = body.text()?;
        let encoding = match encoding.as_str() {
            "cdr" => Some(Encoding::Cdr),
            "ros1" => Some(Encoding::Ros1),
            _ => None,
        };
        let kind = self.schemas.get(&schema).map_or("", String::as_str);
        self.channels.insert(id, self.topics.add(&topic, kind, encoding));
        Ok(())
    }
}

struct Pass<'a, 'b> {
    path: &'a Path,
    /// Offset of the record in the file.
    at: u64,
    index: &'a mut Index,
    wanted: &'a [Cell<bool>],
    each: &'a mut Each<'b>,
    content_limit: ContentLimit,
    bytes: Vec<u8>,
    begin: Option<i64>,
}

impl Pass<'_, '_> {
    fn chunk(&mut self, file: &mut BufReader<File>, length: u64) -> Result<(), ImportError> {
        let path = self.path;
        let at = self.at;
        let mut part = file.by_ref().take(length);
        let head = body::ChunkHead::read(&mut part).at_byte(path, at)?;
        self.content_limit.take(head.content_bytes).at_byte(path, at)?;
        let data = part.by_ref().take(head.data_bytes);
        let content = decompressed(&head.compression, data).at_byte(path, at)?;
        let mut content: Box<dyn Read + '_> = Box::new(Checked::new(content, head.content_bytes, head.crc));
        while let Some(record) = array_or_end(&mut content).at_byte(path, at)? {
            let (kind, length) = split(record);
            self.record(&mut content, kind, length)?;
        }
        drop(content);
        io::copy(&mut part, &mut io::sink()).at_byte(path, at)?;
        Ok(())
    }

    fn record(&mut self, reader: &mut impl Skip, kind: u8, length: u64) -> Result<(), ImportError> {
        let path = self.path;
        let at = self.at;
        match kind {
            SCHEMA | CHANNEL => {
                read_bytes(reader, length, &mut self.bytes).at_byte(path, at)?;
                self.index.add(kind, Body::new(&self.bytes)).at_byte(path, at)
            }
            MESSAGE => {
                let head: [u8; MESSAGE_HEAD as usize] = array(reader).at_byte(path, at)?;
                let data_bytes = length.checked_sub(MESSAGE_HEAD);
                let data_bytes = data_bytes.ok_or(io::ErrorKind::UnexpectedEof.into()).at_byte(path, at)?;
                let mut body = Body::new(&head);
                let channel = body.u16().at_byte(path, at)?;
                let _sequence = body.u32().at_byte(path, at)?;
                let received = body.u64().at_byte(path, at)? as i64;
                let Some(&topic) = self.index.channels.get(&channel) else {
                    let rule = format!("a message of channel {channel}, which is not declared in the file");
                    return Err(ImportError::at_part(path, &format!("byte {at}"), rule));
                };
                self.index.topics.count(topic, 1);
                self.begin = Some(self.begin.map_or(received, |begin| begin.min(received)));
                if !self.wanted.get(topic).is_some_and(Cell::get) {
                    return reader.skip(data_bytes).at_byte(path, at);
                }
                read_bytes(reader, data_bytes, &mut self.bytes).at_byte(path, at)?;
                (self.each)(Message { topic, received, data: &self.bytes })
            }
            _ => reader.skip(length).at_byte(path, at),
        }
    }
}
