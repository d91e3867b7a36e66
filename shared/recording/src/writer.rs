//! Writing a recording, one message at a time.

use super::error::{ForeignFile, RecordingError};
use super::{ABOUT, ENCODING, MAX_RECORD, TICKS};
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};
use messages::pod::bytes_from_rows;
use messages::{ByteTable, Envelope, NoHeader, TickRow, TickTopic};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Size at which a chunk is closed. A message is never split. A killed recorder loses at most the open chunk; an additional chunk
/// costs 100 bytes of index.
const CHUNK_BYTES: u64 = 1 << 20;

/// Writes topics of a run to an MCAP file with chunks, index, checksums and statistics. Memory: two messages.
pub struct RecordingWriter {
    path: PathBuf,
    file: Writer<BufWriter<File>>,
    topics: BTreeMap<String, Channels>,
    data: Vec<u8>,
}

struct Channels {
    messages: u16,
    ticks: u16,
    table: ByteTable,
}

impl RecordingWriter {
    /// Creates or truncates the file. `about` is stored in it with the version of the project.
    pub fn create(path: &Path, about: &BTreeMap<String, String>, tables: &[ByteTable]) -> Result<Self, RecordingError> {
        let file = File::create(path).map_err(|cause| RecordingError::io(path, cause))?;
        let failed = |error| written(path, error);
        let mut file = WriteOptions::new()
            .library(concat!("replica ", env!("CARGO_PKG_VERSION")))
            .profile("")
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            // A chunk is written complete, after its length, so that truncation is detected as such.
            .disable_seeking(true)
            .create(BufWriter::new(file))
            .map_err(failed)?;
        let mut about = about.clone();
        about.insert("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned());
        file.write_metadata(&Metadata { name: ABOUT.to_owned(), metadata: about }).map_err(failed)?;
        let mut topics = BTreeMap::new();
        let tick_table = ByteTable::of::<TickTopic>();
        for table in tables {
            let messages = add_channel(&mut file, &table.topic, table).map_err(failed)?;
            let ticks = add_channel(&mut file, &format!("{}{TICKS}", table.topic), &tick_table).map_err(failed)?;
            topics.insert(table.topic.clone(), Channels { messages, ticks, table: table.clone() });
        }
        Ok(Self { path: path.to_owned(), file, topics, data: Vec::new() })
    }

    /// Appends a message of `topic`, which must have a byte table. `drive_time` is the time of its tick, ns since the Unix epoch.
    pub fn message(
        &mut self,
        topic: &str,
        drive_time: i64,
        envelope: &Envelope,
        header: &[u8],
        rows: &[u8],
    ) -> Result<(), RecordingError> {
        let channels = channels(&self.topics, topic, &self.path)?;
        let table = &channels.table;
        let len = envelope.len as usize;
        let bytes = header.len() + rows.len();
        if header.len() != table.header_bytes || rows.len() != len * table.row_bytes || bytes > MAX_RECORD / 2 {
            return Err(RecordingError::Unwritable {
                path: self.path.clone(),
                topic: topic.to_owned(),
                seq: envelope.seq,
                n_rows: len,
                found: bytes,
                expected: table.header_bytes + len * table.row_bytes,
                limit: MAX_RECORD / 2,
            });
        }
        let id = channels.messages;
        self.append(id, drive_time, envelope.stamp, envelope, header, rows)
    }

    /// Marks a tick of `topic` as complete.
    pub fn tick(&mut self, topic: &str, row: &TickRow) -> Result<(), RecordingError> {
        let id = channels(&self.topics, topic, &self.path)?.ticks;
        let row = TickRow { born_nanos: 0, ..*row };
        let envelope = Envelope { seq: row.tick, stamp: row.drive_time, tick: row.tick, len: 1, ..Envelope::default() };
        let header = NoHeader::default();
        let header = bytes_from_rows(std::slice::from_ref(&header));
        let rows = std::slice::from_ref(&row);
        self.append(id, row.drive_time, row.drive_time, &envelope, header, bytes_from_rows(rows))
    }

    fn append(
        &mut self,
        channel_id: u16,
        drive_time: i64,
        stamp: i64,
        envelope: &Envelope,
        header: &[u8],
        rows: &[u8],
    ) -> Result<(), RecordingError> {
        let envelope = Envelope { born_nanos: 0, sent_nanos: 0, ..*envelope };
        self.data.clear();
        self.data.extend_from_slice(bytes_from_rows(std::slice::from_ref(&envelope)));
        self.data.extend_from_slice(header);
        self.data.extend_from_slice(rows);
        // MCAP times start at 1970; earlier times are clamped.
        let record = MessageHeader {
            channel_id,
            sequence: envelope.seq as u32,
            log_time: drive_time.max(0).cast_unsigned(),
            publish_time: stamp.max(0).cast_unsigned(),
        };
        self.file.write_to_known_channel(&record, &self.data).map_err(|error| written(&self.path, error))
    }

    /// Closes the chunk and passes it to the operating system, so that it survives a crash of this process.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.file.flush().map_err(|error| written(&self.path, error))
    }

    /// Writes indexes and statistics and syncs the file to the disk.
    pub fn finish(mut self) -> Result<(), RecordingError> {
        self.file.finish().map_err(|error| written(&self.path, error))?;
        let file = self.file.into_inner().into_inner().map_err(std::io::IntoInnerError::into_error);
        file.and_then(|file| file.sync_all()).map_err(|cause| RecordingError::io(&self.path, cause))
    }
}

fn channels<'a>(
    topics: &'a BTreeMap<String, Channels>,
    topic: &str,
    path: &Path,
) -> Result<&'a Channels, RecordingError> {
    topics.get(topic).ok_or_else(|| RecordingError::foreign(path, ForeignFile::UndeclaredTopic(topic.to_owned())))
}

fn add_channel(file: &mut Writer<BufWriter<File>>, topic: &str, table: &ByteTable) -> Result<u16, McapError> {
    let text = serde_json::to_vec(table).map_err(|error| McapError::Io(error.into()))?;
    let schema = file.add_schema(&format!("replica.{}.v{}", table.topic, table.version), ENCODING, &text)?;
    file.add_channel(schema, topic, ENCODING, &BTreeMap::new())
}

fn written(path: &Path, error: McapError) -> RecordingError {
    match error {
        McapError::Io(cause) => RecordingError::io(path, cause),
        other => RecordingError::io(path, std::io::Error::other(other)),
    }
}
