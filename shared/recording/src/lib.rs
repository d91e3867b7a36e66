//! Recordings: topics of a run in an MCAP file. Each topic has a channel (`submap`) and a channel for its ticks (`submap.tick`).
//!
//! | MCAP record | content |
//! |---|---|
//! | metadata `replica` | [`RecordingReader::about`]: version of the project, and the recorder's notes about the run |
//! | schema | name `replica.<type>.v<version>`, encoding [`ENCODING`], data: the [`messages::ByteTable`] as JSON |
//! | channel | the topic's name, encoding [`ENCODING`] |
//! | message | envelope (64 bytes), header and rows without gaps by the byte table, little-endian |
//!
//! The log time of a message is the drive time of its tick, the publish time is its stamp. Monotonic clock values of the envelope
//! are set to zero. All other values depend on the drive only, so two recordings of the same run are equal byte for byte.
//!
//! Chunks are written without compression: sweeps and submaps are floats, which compress little and slowly. Recordings
//! rewritten by other programs can be read: compressed by lz4 or zstd, with channels declared just before their first
//! message.
//!
//! The crate mcap reads and writes the container. The layout of messages and the grouping into ticks are specific to REPLICA.

mod chunk;
pub mod compression;
mod contents;
mod error;
mod reader;
mod summary;
mod table;
mod texts;
mod ticks;
mod topic;
mod writer;

pub use error::{ForeignFile, RecordFault, RecordingError};
pub use reader::{Recorded, RecordingReader};
pub use table::kind_bytes;
pub use ticks::{RecordedMessage, RecordedTick, TickReader};
pub use topic::RecordedTopic;
pub use writer::RecordingWriter;

/// Encoding of schemas and messages. No registered encoding means "rows of plain numbers". Programs without support for
/// it can still list topics, counts and times.
pub const ENCODING: &str = "replica-bytes";

/// Name of the metadata record.
const ABOUT: &str = "replica";

/// Suffix of tick channels.
const TICKS: &str = ".tick";

/// Longest record, bytes. A submap of 8 million points needs a quarter of it.
const MAX_RECORD: usize = 1 << 30;
