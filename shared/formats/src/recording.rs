//! Recordings: topics of a run as an MCAP file. One channel per topic (`submap`) and one for its ticks (`submap.tick`).
//!
//! | MCAP record | content |
//! |---|---|
//! | metadata `replica` | [`RecordingReader::about`]: version of the project, and what the recorder said of the run |
//! | schema | name `replica.<type>.v<version>`, encoding [`ENCODING`], data: the [`ByteTable`] as JSON |
//! | channel | the topic's name, encoding [`ENCODING`] |
//! | message | envelope (64 bytes), header, rows without gaps, as the byte table says; little-endian |
//!
//! A message's log time is the drive's time at its tick, its publish time its stamp. The envelope's monotonic clock is
//! zero: what is left follows from the drive alone, so two recordings of the same run are the same bytes.
//!
//! Chunks are not compressed: sweeps and submaps are floats, which shrink little and cost much to pack.

mod reader;
mod ticks;
mod writer;

pub use reader::{Recorded, RecordedTopic, RecordingReader};
pub use ticks::{RecordedMessage, RecordedTick, TickReader};
pub use writer::RecordingWriter;

use messages::ByteTable;
use std::path::{Path, PathBuf};

/// Encoding of schemas and messages. None of the registered ones says "rows of plain numbers"; a reader that does not
/// know it still lists topics, counts and times.
pub const ENCODING: &str = "replica-bytes";

/// Name of the metadata record.
const ABOUT: &str = "replica";

/// Ending of the name of a topic's tick channel.
const TICKS: &str = ".tick";

/// Longest record, bytes. A submap of 8 million points has a quarter of it; what claims more is damaged.
const MAX_RECORD: usize = 1 << 30;

/// Why a file cannot be written or is no recording, or none to the end.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The operating system.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What it said.
        cause: std::io::Error,
    },
    /// No MCAP file, or none with topics of this project, or not the topics that are needed.
    #[error("{}: {rule}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What was found and what must be there.
        rule: String,
    },
    /// Some of it is not what it must be.
    #[error("{}: byte {offset}: {rule}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where, at the latest.
        offset: u64,
        /// What was found and what must be there.
        rule: String,
    },
    /// The file ends too early. What came before is whole.
    #[error("{}: cut at byte {offset}: whole only to byte {whole}; its recorder did not finish it", path.display())]
    Cut {
        /// The file.
        path: PathBuf,
        /// Its length.
        offset: u64,
        /// Up to here it could be read.
        whole: u64,
    },
}

impl RecordingError {
    fn io(path: &Path, cause: std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), cause }
    }
    fn foreign(path: &Path, rule: impl Into<String>) -> Self {
        Self::Foreign { path: path.to_owned(), rule: rule.into() }
    }
}

/// Checks that a table from a file can be worked with: known kinds, fields within what they are fields of.
fn check_table(table: &ByteTable) -> Result<(), String> {
    let parts = [
        ("envelope", &table.envelope, 64),
        ("header", &table.header, table.header_bytes),
        ("row", &table.row, table.row_bytes),
    ];
    if !(1..=MAX_RECORD).contains(&table.row_bytes) || table.header_bytes > MAX_RECORD {
        return Err(format!(
            "byte table of {}: a row must have 1 to {MAX_RECORD} bytes, a header no more",
            table.topic
        ));
    }
    for (part, fields, bytes) in parts {
        for field in fields {
            let size = kind_bytes(&field.kind).and_then(|size| size.checked_mul(field.count));
            let end = size.and_then(|size| size.checked_add(field.offset));
            if end.is_none_or(|end| end > bytes) {
                let what = format!("byte table of {}: {part} field {}", table.topic, field.name);
                return Err(format!(
                    "{what}: {} {} at {} must lie within {bytes} bytes",
                    field.count, field.kind, field.offset
                ));
            }
        }
    }
    Ok(())
}

/// Bytes of a number of a [`messages::ByteField::kind`]; `None` if there is no such kind.
pub fn kind_bytes(kind: &str) -> Option<usize> {
    match kind {
        "u8" | "i8" => Some(1),
        "u16" | "i16" => Some(2),
        "u32" | "i32" | "f32" => Some(4),
        "u64" | "i64" | "f64" => Some(8),
        _ => None,
    }
}
