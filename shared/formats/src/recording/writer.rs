//! Writing a recording, one message at a time.

use super::{ABOUT, ENCODING, MAX_RECORD, RecordingError, TICKS};
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};
use messages::pod::bytes_from_rows;
use messages::{ByteTable, Envelope, NoHeader, Tick, TickRow};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// A chunk is closed when it has so many bytes; a message stands in one chunk whole. A killed recorder loses at most the
/// open chunk, and a small one costs 100 bytes of index.
const CHUNK_BYTES: u64 = 1 << 20;

/// Writes topics of a run into an MCAP file: chunked, indexed, with checksums and statistics. Memory: two messages.
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
    /// Creates the file, or empties it. `about` is kept in it beside the project's version.
    pub fn create(path: &Path, about: &BTreeMap<String, String>, tables: &[ByteTable]) -> Result<Self, RecordingError> {
        let file = File::create(path).map_err(|cause| RecordingError::io(path, cause))?;
        let failed = |error| written(path, error);
        let mut file = WriteOptions::new()
            .library(concat!("replica ", env!("CARGO_PKG_VERSION")))
            .profile("")
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            // A chunk is written when it is whole, behind its length: a cut is then seen for what it is.
            .disable_seeking(true)
            .create(BufWriter::new(file))
            .map_err(failed)?;
        let mut about = about.clone();
        about.insert("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned());
        file.write_metadata(&Metadata { name: ABOUT.to_owned(), metadata: about }).map_err(failed)?;
        let mut topics = BTreeMap::new();
        let tick_table = ByteTable::of::<Tick>();
        for table in tables {
            let messages = add_channel(&mut file, &table.topic, table).map_err(failed)?;
            let ticks = add_channel(&mut file, &format!("{}{TICKS}", table.topic), &tick_table).map_err(failed)?;
            topics.insert(table.topic.clone(), Channels { messages, ticks, table: table.clone() });
        }
        Ok(Self { path: path.to_owned(), file, topics, data: Vec::new() })
    }

    /// Appends a message of `topic`, one of the tables' topics. `drive_time` is that of its tick, ns since the Unix epoch.
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
        let (len, bytes) = (envelope.len as usize, header.len() + rows.len());
        if header.len() != table.header_bytes || rows.len() != len * table.row_bytes || bytes > MAX_RECORD / 2 {
            let rule = format!(
                "{topic} message {} has {} + {} bytes; its {len} rows must have {} + {}, and at most {} in all",
                envelope.seq,
                header.len(),
                rows.len(),
                table.header_bytes,
                len * table.row_bytes,
                MAX_RECORD / 2
            );
            return Err(RecordingError::foreign(&self.path, rule));
        }
        let id = channels.messages;
        self.append(id, drive_time, envelope.stamp, envelope, header, rows)
    }

    /// Says that a tick of `topic` is complete.
    pub fn tick(&mut self, topic: &str, row: &TickRow) -> Result<(), RecordingError> {
        let id = channels(&self.topics, topic, &self.path)?.ticks;
        let row = TickRow { born_nanos: 0, ..*row };
        let envelope = Envelope { seq: row.tick, stamp: row.drive_time, tick: row.tick, len: 1, ..Envelope::default() };
        let header = NoHeader::default();
        let (header, rows) = (bytes_from_rows(std::slice::from_ref(&header)), std::slice::from_ref(&row));
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
        // MCAP counts from 1970 on; what is before it is at its beginning.
        let record = MessageHeader {
            channel_id,
            sequence: envelope.seq as u32,
            log_time: drive_time.max(0).cast_unsigned(),
            publish_time: stamp.max(0).cast_unsigned(),
        };
        self.file.write_to_known_channel(&record, &self.data).map_err(|error| written(&self.path, error))
    }

    /// Closes the chunk and brings it to the operating system: what has been written survives this process.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.file.flush().map_err(|error| written(&self.path, error))
    }

    /// Writes indexes and statistics and brings the file to the disk.
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
    topics.get(topic).ok_or_else(|| RecordingError::foreign(path, format!("topic {topic} is none of this recording")))
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
