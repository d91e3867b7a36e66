//! Reading a recording from its beginning to its end, one message at a time.

use super::{ABOUT, ENCODING, MAX_RECORD, RecordingError, TICKS, check_table};
use mcap::McapError;
use mcap::records::{Channel, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use messages::pod::rows_from_bytes;
use messages::{ByteTable, Envelope, Message, Tick, TickRow};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// A channel of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedTopic {
    /// Name of the channel: `submap`, `submap.tick`.
    pub name: String,
    /// What its messages look like.
    pub table: ByteTable,
}

impl RecordedTopic {
    /// The topic whose ticks these are, if they are ticks.
    pub fn ticks_of(&self) -> Option<&str> {
        self.name.strip_suffix(TICKS).filter(|_| self.table.topic == Tick::TOPIC)
    }
}

/// A message, in the reader's memory until the next.
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'a> {
    /// Its channel.
    pub topic: &'a RecordedTopic,
    /// Its envelope.
    pub envelope: Envelope,
    /// Envelope, header and rows.
    pub bytes: &'a [u8],
}

impl<'a> Recorded<'a> {
    /// The header's bytes.
    pub fn header(&self) -> &'a [u8] {
        &self.bytes[size_of::<Envelope>()..][..self.topic.table.header_bytes]
    }
    /// The rows' bytes.
    pub fn rows(&self) -> &'a [u8] {
        &self.bytes[size_of::<Envelope>() + self.topic.table.header_bytes..]
    }
    /// The row of a tick, if this is one.
    pub fn tick_row(&self) -> Option<TickRow> {
        let rows = self.topic.ticks_of().and_then(|_| rows_from_bytes(self.rows()))?;
        rows.first().copied()
    }
}

/// Reads a recording of any length in the memory of its largest chunk.
pub struct RecordingReader {
    path: PathBuf,
    file: BufReader<File>,
    remaining: u64,
    length: u64,
    /// Up to here records have been seen whole.
    whole: u64,
    records: LinearReader,
    schemas: BTreeMap<u16, Result<ByteTable, String>>,
    /// Place in `topics`; `None`: somebody else's channel.
    channels: BTreeMap<u16, Option<usize>>,
    topics: Vec<RecordedTopic>,
    about: BTreeMap<String, String>,
    /// The last message that was read.
    data: Vec<u8>,
    /// What reading the first message came to, until it is asked for.
    first: Option<Result<Option<usize>, RecordingError>>,
    done: bool,
}

impl RecordingReader {
    /// Opens the file and reads on to its first message, so that its topics are known.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = File::open(path).map_err(|cause| RecordingError::io(path, cause))?;
        let length = file.metadata().map_err(|cause| RecordingError::io(path, cause))?.len();
        let options = LinearReaderOptions::default()
            // No message is passed on before its chunk has proved whole.
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
            _ if length < mcap::MAGIC.len() as u64 => return Err(RecordingError::foreign(path, "is no MCAP file")),
            _ if reader.topics.is_empty() && !is_cut => {
                let rule = format!("is no recording of REPLICA: it has no channel with the encoding {ENCODING}");
                return Err(RecordingError::foreign(path, rule));
            }
            first => reader.first = Some(first),
        }
        Ok(reader)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The channels found so far; all, unless the file is cut or was written by somebody else.
    pub fn topics(&self) -> &[RecordedTopic] {
        &self.topics
    }

    /// What the recorder said of the run.
    pub fn about(&self) -> &BTreeMap<String, String> {
        &self.about
    }

    /// The next message of any channel. `None` at the end of a whole file; nothing comes after an error.
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

    /// An error at the place that has been reached.
    pub(super) fn damaged(&self, rule: impl Into<String>) -> RecordingError {
        RecordingError::Damaged { path: self.path.clone(), offset: self.length - self.remaining, rule: rule.into() }
    }

    /// Reads up to the next message of ours, into `data`; the place of its topic.
    fn advance(&mut self) -> Result<Option<usize>, RecordingError> {
        loop {
            let cut = RecordingError::Cut { path: self.path.clone(), offset: self.length, whole: self.whole };
            let offset = self.length - self.remaining;
            let damaged = |rule: String| RecordingError::Damaged { path: self.path.clone(), offset, rule };
            let Some(event) = self.records.next_event() else { return Ok(None) };
            match event {
                Err(McapError::UnexpectedEof) => return Err(cut),
                Err(McapError::BadMagic) if self.whole == 0 => {
                    return Err(RecordingError::foreign(&self.path, "is no MCAP file"));
                }
                Err(error) => return Err(damaged(explained(&error))),
                Ok(LinearReadEvent::ReadRequest(n)) => {
                    // Asking for more than there is, to be sure that nothing follows, is the reader's way to the end.
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
                    match mcap::parse_record(opcode, data).map_err(|error| damaged(explained(&error)))? {
                        Record::Schema { header, data } if header.encoding == ENCODING => {
                            self.schemas.insert(header.id, table_of(&data));
                        }
                        Record::Channel(channel) => {
                            let known = self.channels.contains_key(&channel.id);
                            if known {
                                // The summary repeats them.
                                continue;
                            }
                            let (id, topic) = (channel.id, topic_of(channel, &self.schemas).map_err(damaged)?);
                            if let Some(twin) =
                                topic.as_ref().and_then(|t| self.topics.iter().find(|o| o.name == t.name))
                            {
                                return Err(damaged(format!("topic {} has a second channel", twin.name)));
                            }
                            self.channels.insert(id, topic.as_ref().map(|_| self.topics.len()));
                            self.topics.extend(topic);
                        }
                        Record::Metadata(metadata) if metadata.name == ABOUT => self.about = metadata.metadata,
                        Record::Message { header, data } => {
                            let id = header.channel_id;
                            let index = self.channels.get(&id);
                            let index = index.ok_or_else(|| damaged(format!("a message of unknown channel {id}")))?;
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

fn table_of(data: &[u8]) -> Result<ByteTable, String> {
    let table: ByteTable =
        serde_json::from_slice(data).map_err(|error| format!("a schema that is no byte table: {error}"))?;
    check_table(&table).map(|()| table)
}

/// `None`: somebody else's channel.
fn topic_of(
    channel: Channel,
    schemas: &BTreeMap<u16, Result<ByteTable, String>>,
) -> Result<Option<RecordedTopic>, String> {
    if channel.message_encoding != ENCODING {
        return Ok(None);
    }
    let table = schemas.get(&channel.schema_id).ok_or_else(|| format!("channel {} has no schema", channel.topic))?;
    Ok(Some(RecordedTopic { name: channel.topic, table: table.clone()? }))
}

fn check_length(topic: &RecordedTopic, bytes: &[u8]) -> Result<(), String> {
    let (table, n_bytes) = (&topic.table, bytes.len());
    let Some(envelope) = envelope_of(bytes) else {
        return Err(format!("a message of {} has {n_bytes} bytes, its envelope alone must have 64", topic.name));
    };
    let rows = (envelope.len as usize).checked_mul(table.row_bytes);
    let expected = rows.and_then(|rows| rows.checked_add(size_of::<Envelope>() + table.header_bytes));
    if expected == Some(n_bytes) && envelope.len as usize <= table.max_rows {
        return Ok(());
    }
    let (seq, len, row_bytes) = (envelope.seq, envelope.len, table.row_bytes);
    Err(format!(
        "message {seq} of {} has {n_bytes} bytes; {len} rows of {row_bytes} bytes behind 64 + {} were expected, at most {} rows",
        topic.name, table.header_bytes, table.max_rows
    ))
}

fn explained(error: &McapError) -> String {
    match error {
        McapError::UnsupportedCompression(name) => {
            format!("chunks are compressed with {name}; those of a recording are not (`mcap decompress` unpacks them)")
        }
        other => other.to_string(),
    }
}
