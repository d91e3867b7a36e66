//! Reading a recording sequentially, one message at a time.

use super::error::{ForeignFile, RecordFault, RecordingError};
use super::{ABOUT, ENCODING, MAX_RECORD, TICKS, table, texts};
use mcap::McapError;
use mcap::records::{Channel, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use messages::pod::rows_from_bytes;
use messages::{ByteTable, Envelope, Message, TickRow, TickTopic};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// A channel of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedTopic {
    /// Name of the channel: `submap`, `submap.tick`.
    pub name: String,
    /// Layout of its messages.
    pub table: ByteTable,
}

impl RecordedTopic {
    /// For a tick channel, the topic that the ticks belong to.
    pub fn ticks_of(&self) -> Option<&str> {
        self.name.strip_suffix(TICKS).filter(|_| self.table.topic == TickTopic::TOPIC)
    }
}

/// A message in the memory of the reader, valid until the next message is read.
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'a> {
    /// Channel of the message.
    pub topic: &'a RecordedTopic,
    /// Envelope of the message.
    pub envelope: Envelope,
    /// Envelope, header and rows.
    pub bytes: &'a [u8],
}

impl<'a> Recorded<'a> {
    /// Bytes of the header.
    pub fn header(&self) -> &'a [u8] {
        &self.bytes[size_of::<Envelope>()..][..self.topic.table.header_bytes]
    }
    /// Bytes of the rows.
    pub fn rows(&self) -> &'a [u8] {
        &self.bytes[size_of::<Envelope>() + self.topic.table.header_bytes..]
    }
    /// The row of a tick message; `None` for other messages.
    pub fn tick_row(&self) -> Option<TickRow> {
        let rows = self.topic.ticks_of().and_then(|_| rows_from_bytes(self.rows()))?;
        rows.first().copied()
    }
}

/// Reads a recording of any size. Memory: its largest chunk.
pub struct RecordingReader {
    path: PathBuf,
    file: BufReader<File>,
    remaining: u64,
    length: u64,
    /// End of the last complete record.
    whole: u64,
    records: LinearReader,
    schemas: BTreeMap<u16, Result<ByteTable, RecordFault>>,
    /// Index into `topics`; `None` for channels of other programs.
    channels: BTreeMap<u16, Option<usize>>,
    topics: Vec<RecordedTopic>,
    about: BTreeMap<String, String>,
    /// Bytes of the last message.
    data: Vec<u8>,
    /// Result of reading the first message, until it is requested.
    first: Option<Result<Option<usize>, RecordingError>>,
    done: bool,
}

impl RecordingReader {
    /// Opens the file and reads up to its first message, so that the topics are known.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = File::open(path).map_err(|cause| RecordingError::io(path, cause))?;
        let length = file.metadata().map_err(|cause| RecordingError::io(path, cause))?.len();
        let options = LinearReaderOptions::default()
            // Chunks are verified before their first message is returned.
            .with_prevalidate_chunk_crcs(true)
            .with_validate_data_section_crc(true)
            .with_validate_summary_section_crc(true)
            .with_check_finishes_after_end_magic(true)
            .with_record_length_limit(MAX_RECORD);
        let mut reader = Self {
            path: path.to_owned(),
            file: BufReader::with_capacity(1 << 16, file),
            remaining: length,
            length,
            whole: 0,
            records: LinearReader::new_with_options(options),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            topics: Vec::new(),
            about: BTreeMap::new(),
            data: Vec::new(),
            first: None,
            done: false,
        };
        let first = reader.advance();
        let is_cut = matches!(first, Err(RecordingError::Cut { .. }));
        match first {
            Err(error) if !is_cut => return Err(error),
            _ if length < mcap::MAGIC.len() as u64 => return Err(RecordingError::foreign(path, ForeignFile::NotMcap)),
            _ if reader.topics.is_empty() && !is_cut => {
                return Err(RecordingError::foreign(path, ForeignFile::NoTopics));
            }
            first => reader.first = Some(first),
        }
        Ok(reader)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Channels found so far: all, unless the file is truncated or was written by another program.
    pub fn topics(&self) -> &[RecordedTopic] {
        &self.topics
    }

    /// Notes of the recorder about the run.
    pub fn about(&self) -> &BTreeMap<String, String> {
        &self.about
    }

    /// The next message of any channel. `None` at the end of a complete file and after an error.
    #[expect(clippy::should_implement_trait, reason = "an iterator's items cannot borrow from it")]
    pub fn next(&mut self) -> Result<Option<Recorded<'_>>, RecordingError> {
        let index = match self.first.take() {
            Some(first) => first,
            None if self.done => Ok(None),
            None => self.advance(),
        };
        self.done |= !matches!(index, Ok(Some(_)));
        let Some(index) = index? else { return Ok(None) };
        let Some(envelope) = envelope_of(&self.data) else { return Ok(None) };
        Ok(Some(Recorded { topic: &self.topics[index], envelope, bytes: &self.data }))
    }

    /// An error at the current position.
    pub(super) fn damaged(&self, fault: RecordFault) -> RecordingError {
        RecordingError::Damaged { path: self.path.clone(), offset: self.length - self.remaining, fault }
    }

    /// Reads the next message of a known topic into `data`. Returns the index of the topic.
    fn advance(&mut self) -> Result<Option<usize>, RecordingError> {
        loop {
            let cut = RecordingError::Cut { path: self.path.clone(), offset: self.length, whole: self.whole };
            let offset = self.length - self.remaining;
            let damaged = |fault: RecordFault| RecordingError::Damaged { path: self.path.clone(), offset, fault };
            let Some(event) = self.records.next_event() else { return Ok(None) };
            match event {
                Err(McapError::UnexpectedEof) => return Err(cut),
                Err(McapError::BadMagic) if self.whole == 0 => {
                    return Err(RecordingError::foreign(&self.path, ForeignFile::NotMcap));
                }
                Err(error) => return Err(damaged(mcap_fault(&error))),
                Ok(LinearReadEvent::ReadRequest(n)) => {
                    // At the end the reader requests more bytes than remain, to verify that nothing follows.
                    if n as u64 > self.remaining && self.remaining > 0 {
                        return Err(cut);
                    }
                    let n = n.min(self.remaining as usize);
                    let space = &mut self.records.insert(n)[..n];
                    self.file.read_exact(space).map_err(|cause| RecordingError::io(&self.path, cause))?;
                    self.records.notify_read(n);
                    self.remaining -= n as u64;
                }
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    self.whole = offset;
                    if ![op::SCHEMA, op::CHANNEL, op::METADATA, op::MESSAGE].contains(&opcode) {
                        continue;
                    }
                    texts::check(opcode, data).map_err(damaged)?;
                    match mcap::parse_record(opcode, data).map_err(|error| damaged(mcap_fault(&error)))? {
                        Record::Schema { header, data } if header.encoding == ENCODING => {
                            self.schemas.insert(header.id, parse_table(&data));
                        }
                        Record::Channel(channel) => {
                            let known = self.channels.contains_key(&channel.id);
                            if known {
                                // The summary section repeats channels.
                                continue;
                            }
                            let (id, topic) = (channel.id, topic_of(channel, &self.schemas).map_err(damaged)?);
                            if let Some(twin) =
                                topic.as_ref().and_then(|t| self.topics.iter().find(|o| o.name == t.name))
                            {
                                return Err(damaged(RecordFault::DuplicateTopic(twin.name.clone())));
                            }
                            self.channels.insert(id, topic.as_ref().map(|_| self.topics.len()));
                            self.topics.extend(topic);
                        }
                        Record::Metadata(metadata) if metadata.name == ABOUT => self.about = metadata.metadata,
                        Record::Message { header, data } => {
                            let id = header.channel_id;
                            let index = self.channels.get(&id);
                            let index = index.ok_or_else(|| damaged(RecordFault::UndeclaredChannel(id)))?;
                            let Some(index) = *index else { continue };
                            self.data.clear();
                            self.data.extend_from_slice(&data);
                            check_length(&self.topics[index], &data).map_err(damaged)?;
                            return Ok(Some(index));
                        }
                        _ => {}
                    }
                }
            }
        }
    }
}

fn envelope_of(bytes: &[u8]) -> Option<Envelope> {
    rows_from_bytes::<Envelope>(bytes.get(..size_of::<Envelope>())?)?.first().copied()
}

fn parse_table(data: &[u8]) -> Result<ByteTable, RecordFault> {
    let parsed: ByteTable = serde_json::from_slice(data).map_err(|error| RecordFault::Schema(error.to_string()))?;
    table::check(&parsed).map(|()| parsed)
}

/// `None` for channels of other programs.
fn topic_of(
    channel: Channel,
    schemas: &BTreeMap<u16, Result<ByteTable, RecordFault>>,
) -> Result<Option<RecordedTopic>, RecordFault> {
    if channel.message_encoding != ENCODING {
        return Ok(None);
    }
    match schemas.get(&channel.schema_id) {
        Some(table) => Ok(Some(RecordedTopic { name: channel.topic, table: table.clone()? })),
        None => Err(RecordFault::NoSchema(channel.topic)),
    }
}

fn check_length(topic: &RecordedTopic, bytes: &[u8]) -> Result<(), RecordFault> {
    let (table, n_bytes) = (&topic.table, bytes.len());
    let Some(envelope) = envelope_of(bytes) else {
        return Err(RecordFault::NoEnvelope { topic: topic.name.clone(), n_bytes });
    };
    let rows = (envelope.len as usize).checked_mul(table.row_bytes);
    let expected = rows.and_then(|rows| rows.checked_add(size_of::<Envelope>() + table.header_bytes));
    if expected == Some(n_bytes) && envelope.len as usize <= table.max_rows {
        return Ok(());
    }
    let (seq, n_rows) = (envelope.seq, envelope.len);
    let &ByteTable { header_bytes, row_bytes, max_rows, .. } = table;
    let topic = topic.name.clone();
    Err(RecordFault::MessageSize { topic, seq, n_bytes, header_bytes, n_rows, row_bytes, max_rows })
}

fn mcap_fault(error: &McapError) -> RecordFault {
    match error {
        McapError::UnsupportedCompression(name) => RecordFault::Compressed(name.clone()),
        other => RecordFault::Mcap(other.to_string()),
    }
}
