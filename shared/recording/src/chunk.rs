//! The records of a chunk or of the summary. The library would read a record past the end of its chunk.

use super::error::{RecordFault, mcap_fault};
use super::{MAX_RECORD, texts};
use crate::compression::{ContentLimit, decompressed};
use mcap::McapError;
use mcap::records::{ChunkHeader, Record, op};
use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;

/// Bytes before the body of a record: its opcode and its length.
const HEAD_BYTES: usize = 9;

/// An open chunk; empty before the first chunk is opened.
#[derive(Default)]
pub(super) struct Chunk {
    bytes: Vec<u8>,
    /// Offset of the next record.
    at: usize,
}

impl Chunk {
    /// A chunk of records that are already in memory.
    pub fn from_records(bytes: Vec<u8>) -> Self {
        Self { bytes, at: 0 }
    }

    /// Opens the chunk of a record with this body, after a check of its checksum. `limit` is the limit of the file.
    pub fn open(&mut self, body: &[u8], limit: &mut ContentLimit) -> Result<(), RecordFault> {
        self.bytes.clear();
        self.at = 0;
        texts::check(op::CHUNK, body)?;
        let record = mcap::parse_record(op::CHUNK, body).map_err(|error| mcap_fault(&error))?;
        let Record::Chunk { header, data } = record else { return Ok(()) };
        let content = content(&header, data, limit)?;
        // 0: no checksum.
        let saved = header.uncompressed_crc;
        let calculated = crc32fast::hash(&content);
        if saved != 0 && saved != calculated {
            return Err(mcap_fault(&McapError::BadChunkCrc { saved, calculated }));
        }
        self.bytes.extend_from_slice(&content);
        Ok(())
    }

    /// Opcode and body of the next record; `None` at the end of the chunk.
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

/// The records of a chunk, decompressed.
fn content<'a>(
    header: &ChunkHeader,
    data: Cow<'a, [u8]>,
    limit: &mut ContentLimit,
) -> Result<Cow<'a, [u8]>, RecordFault> {
    let with = &header.compression;
    let size = header.uncompressed_size;
    if with.is_empty() {
        return Ok(data);
    }
    let fault = |cause: String| RecordFault::Compressed { with: with.clone(), cause };
    let stated = size.min(MAX_RECORD as u64);
    let mut content = Vec::new();
    let chunk = limit.take(stated).and_then(|()| decompressed(with, &*data));
    // Requests one byte more than stated, to detect excess content.
    let read = chunk.and_then(|chunk| chunk.take(stated + 1).read_to_end(&mut content));
    match read.map_err(|error| fault(error.to_string()))? {
        n_bytes if n_bytes as u64 == size => Ok(content.into()),
        n_bytes => Err(fault(format!("{n_bytes} bytes of content or more, the chunk states {size}"))),
    }
}

/// Range of the body after the start of its record, of which `left` bytes follow the head.
fn body_range(length: u64, left: usize) -> Option<Range<usize>> {
    let length = usize::try_from(length).ok().filter(|length| *length <= left)?;
    Some(HEAD_BYTES..HEAD_BYTES + length)
}
