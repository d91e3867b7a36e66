//! Errors of recordings.

use mcap::McapError;
use messages::ByteField;
use std::path::{Path, PathBuf};

/// Error of a recording that cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The operating system reported an error.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        cause: std::io::Error,
    },
    /// The file is not a recording, or lacks required topics.
    #[error("{}: {reason}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The content found and the content expected.
        reason: ForeignFile,
    },
    /// A message does not match the byte table of its topic.
    #[error("{}: {topic} message {seq} has {found} bytes of header and rows, its {n_rows} rows need {expected}, at most {limit}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// Topic of the message.
        topic: String,
        /// Sequence number of the message.
        seq: u64,
        /// Rows of the message.
        n_rows: usize,
        /// Bytes of header and rows.
        found: usize,
        /// Bytes by the byte table.
        expected: usize,
        /// Most bytes of a message.
        limit: usize,
    },
    /// A part of the file is invalid.
    #[error("{}: byte {offset}: {fault}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Offset at which the fault was detected; its cause may be earlier.
        offset: u64,
        /// Fault of the record.
        fault: RecordFault,
    },
    /// The file is truncated. Everything before the cut was read.
    #[error("{}: cut at byte {offset}, complete up to byte {whole}; the recorder did not finish the file", path.display())]
    Cut {
        /// The file.
        path: PathBuf,
        /// Size of the file.
        offset: u64,
        /// End of the last complete record.
        whole: u64,
    },
}

/// Reason why a file is not the expected recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ForeignFile {
    /// The file is not MCAP.
    #[error("not an MCAP file")]
    NotMcap,
    /// The MCAP file was written by another program.
    #[error("not a recording of REPLICA: no channel has the encoding {}", super::ENCODING)]
    NoTopics,
    /// A topic is not in the recording.
    #[error("no topic {wanted} with its ticks; the recording has {}", found.join(", "))]
    MissingTopic {
        /// Topic that was requested.
        wanted: String,
        /// Topics of the recording.
        found: Vec<String>,
    },
    /// A reader of ticks was opened without topics, so the end of the recording cannot be determined.
    #[error("no topic was requested; the recording has {}", found.join(", "))]
    NoTopicRequested {
        /// Topics of the recording.
        found: Vec<String>,
    },
    /// A message was written to a topic that was not declared when the recording was created.
    #[error("topic {0} was not declared when the recording was created")]
    UndeclaredTopic(String),
}

/// Fault of a record.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecordFault {
    /// The MCAP library reported an error.
    #[error("{0}")]
    Mcap(String),
    /// A text is longer than the record that contains it.
    #[error("{record} has a text of {found} bytes where {left} bytes are left")]
    TextLength {
        /// Type of the record.
        record: &'static str,
        /// Length of the text.
        found: u64,
        /// Bytes to the end of the record.
        left: usize,
    },
    /// A record does not end within its chunk.
    #[error("chunk with {left} bytes left has a record of kind {opcode} with {}", length_text(*found))]
    ChunkRecord {
        /// Opcode of the record.
        opcode: u8,
        /// Length of its body; `None` if the chunk ends before it.
        found: Option<u64>,
        /// Bytes of the chunk from the start of the record.
        left: usize,
    },
    /// A compressed chunk cannot be read.
    #[error("chunk compressed with {with}: {cause}")]
    Compressed {
        /// Name of the compression.
        with: String,
        /// Error of the decompression.
        cause: String,
    },
    /// A channel is declared after messages, and no summary lists it: it was unknown when the topics were chosen.
    #[error(
        "topic {0} begins after other messages and the file has no summary; write it again with one (`mcap recover`)"
    )]
    LateChannel(String),
    /// A message belongs to no channel.
    #[error("message of undeclared channel {0}")]
    UndeclaredChannel(u16),
    /// Two channels have the same topic.
    #[error("topic {0} has two channels")]
    DuplicateTopic(String),
    /// A channel has no schema.
    #[error("channel {0} has no schema")]
    NoSchema(String),
    /// A schema is not a byte table.
    #[error("schema is not a byte table: {0}")]
    Schema(String),
    /// Sizes of a byte table are out of range.
    #[error(
        "byte table of {topic}: header of {header_bytes} and row of {row_bytes} bytes; expected up to {limit}, and at least 1 for a row"
    )]
    TableSize {
        /// Topic of the table.
        topic: String,
        /// Bytes of the header.
        header_bytes: usize,
        /// Bytes of a row.
        row_bytes: usize,
        /// Most bytes of either.
        limit: usize,
    },
    /// A field of a byte table lies outside its part, or has an unknown kind.
    #[error(
        "byte table of {topic}: {part} field {}: {} {} at {} must lie within {bytes} bytes",
        field.name, field.count, field.kind, field.offset
    )]
    TableField {
        /// Topic of the table.
        topic: String,
        /// `envelope`, `header` or `row`.
        part: &'static str,
        /// The field.
        field: Box<ByteField>,
        /// Bytes of the part.
        bytes: usize,
    },
    /// A message is too short for an envelope.
    #[error("message of {topic} has {n_bytes} bytes, an envelope needs 64")]
    NoEnvelope {
        /// Topic of the message.
        topic: String,
        /// Bytes of the message.
        n_bytes: usize,
    },
    /// The size of a message does not match its envelope.
    #[error(
        "message {seq} of {topic} has {n_bytes} bytes; expected an envelope of 64, a header of {header_bytes} and {n_rows} rows of \
         {row_bytes} bytes, at most {max_rows} rows"
    )]
    MessageSize {
        /// Topic of the message.
        topic: String,
        /// Sequence number of the message.
        seq: u64,
        /// Bytes of the message.
        n_bytes: usize,
        /// Bytes of the header.
        header_bytes: usize,
        /// Rows by the envelope.
        n_rows: u32,
        /// Bytes of a row.
        row_bytes: usize,
        /// Most rows of a message.
        max_rows: usize,
    },
    /// A tick message has no row.
    #[error("tick of {0} has no row")]
    EmptyTick(String),
    /// The recording does not start with the run.
    #[error("{topic} begins with {what} {number}; a recording must begin with its run")]
    LateBegin {
        /// The topic.
        topic: String,
        /// `message` or `tick`.
        what: &'static str,
        /// First number found.
        number: u64,
    },
    /// A message or tick is missing.
    #[error("{what} {found} of {topic} follows where {expected} is expected; {what}s are missing")]
    Gap {
        /// The topic.
        topic: String,
        /// `message` or `tick`.
        what: &'static str,
        /// Number found.
        found: u64,
        /// Number expected.
        expected: u64,
    },
    /// Messages of a tick are missing.
    #[error("tick {tick} of {topic} follows {found} messages, {expected} were published; messages are missing")]
    MissingMessages {
        /// The topic.
        topic: String,
        /// The tick.
        tick: u64,
        /// Messages found.
        found: u64,
        /// Messages published.
        expected: u64,
    },
    /// Messages are too far ahead of their tick.
    #[error("{n} messages of {topic} precede the tick they belong to; the file is not in the order of ticks")]
    EarlyMessages {
        /// The topic.
        topic: String,
        /// Messages held.
        n: usize,
    },
    /// One topic is too far ahead of another.
    #[error("{topic} is more than {limit} ticks ahead of another topic; the file is not in the order of ticks")]
    EarlyTicks {
        /// The topic.
        topic: String,
        /// Most ticks ahead.
        limit: usize,
    },
    /// Two topics have different ticks of the same number.
    #[error("tick {tick}: {topic} and {other} differ in number, barrier or end")]
    TickMismatch {
        /// The tick of `other`.
        tick: u64,
        /// A topic.
        topic: String,
        /// Another topic.
        other: String,
    },
}

fn length_text(length: Option<u64>) -> String {
    length.map_or_else(|| "a cut length".to_owned(), |length| format!("a head of 9 bytes and {length} more"))
}

impl RecordingError {
    pub(super) fn io(path: &Path, cause: std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), cause }
    }
    pub(super) fn foreign(path: &Path, reason: ForeignFile) -> Self {
        Self::Foreign { path: path.to_owned(), reason }
    }
}

/// The fault for an error of the library `mcap`.
pub(super) fn mcap_fault(error: &McapError) -> RecordFault {
    RecordFault::Mcap(error.to_string())
}
