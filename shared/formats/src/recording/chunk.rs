//! The records of a chunk. The library would read a record beyond the end of its chunk.

use super::error::{RecordFault, mcap_fault};
use super::texts;
use mcap::McapError;
use mcap::records::{Record, op};
use std::ops::Range;

/// Bytes before the body of a record: its kind and its length.
const HEAD_BYTES: usize = 9;

/// An open chunk; without bytes before the first one.
#[derive(Default)]
pub(super) struct Chunk {
    bytes: Vec<u8>,
    /// Where the next record begins.
    at: usize,
}

impl Chunk {
    /// Opens the chunk of a record with this body, after a check of its sum.
    pub fn open(&mut self, body: &[u8]) -> Result<(), RecordFault> {
        self.bytes.clear();
        self.at = 0;
        texts::check(op::CHUNK, body)?;
        let record = mcap::parse_record(op::CHUNK, body).map_err(|error| mcap_fault(&error))?;
        let Record::Chunk { header, data } = record else { return Ok(()) };
        if !header.compression.is_empty() {
            return Err(RecordFault::Compressed(header.compression));
        }
        // 0: not stated.
        let (saved, calculated) = (header.uncompressed_crc, crc32fast::hash(&data));
        if saved != 0 && saved != calculated {
            return Err(mcap_fault(&McapError::BadChunkCrc { saved, calculated }));
        }
        self.bytes.extend_from_slice(&data);
        Ok(())
    }

    /// Kind and body of the next record; `None` at the end of the chunk.
    pub fn next(&mut self) -> Result<Option<(u8, &[u8])>, RecordFault> {
        let rest = &self.bytes[self.at..];
        let Some(&opcode) = rest.first() else { return Ok(None) };
        let left = rest.len().saturating_sub(HEAD_BYTES);
        let length = rest.get(1..HEAD_BYTES).and_then(|bytes| bytes.try_into().ok()).map(u64::from_le_bytes);
        let Some(body) = length.and_then(|length| body_range(length, left)) else {
            return Err(RecordFault::ChunkRecord { opcode, found: length, left: rest.len() });
        };
        self.at += body.end;
        Ok(Some((opcode, &rest[body])))
    }
}

/// Where the body lies behind the begin of its record, of which `left` bytes follow the head.
fn body_range(length: u64, left: usize) -> Option<Range<usize>> {
    let length = usize::try_from(length).ok().filter(|length| *length <= left)?;
    Some(HEAD_BYTES..HEAD_BYTES + length)
}
