//! Reading a recording sequentially, one message at a time.

use super::MAX_RECORD;
use super::chunk::Chunk;
use super::contents::{Contents, envelope_of};
use super::error::{ForeignFile, RecordFault, RecordingError, mcap_fault};
use super::summary;
use super::topic::RecordedTopic;
use crate::compression::ContentLimit;
use files::regular_file;
use mcap::McapError;
use mcap::records::op;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use messages::pod::rows_from_bytes;
use messages::{Envelope, TickRow};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// A message in the memory of the reader, valid until the next message is read.
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'a> {
    /// Channel of the message.
    pub topic: &'a RecordedTopic,
    /// Index of the channel in [`RecordingReader::topics`].
    pub(super) index: usize,
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
    chunk: Chunk,
    limit: ContentLimit,
    contents: Contents,
    /// Result of reading the first message, kept until it is requested.
    first: Option<Result<Option<usize>, RecordingError>>,
    done: bool,
}

impl RecordingReader {
    /// Opens the file and reads up to its first message and the summary, so that the topics are known.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = regular_file::open(path).map_err(|cause| RecordingError::io(path, cause))?;
        let length = file.metadata().map_err(|cause| RecordingError::io(path, cause))?.len();
        let options = LinearReaderOptions::default()
            // See `Chunk`.
            .with_emit_chunks(true)
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
            chunk: Chunk::default(),
            limit: ContentLimit::for_file(length),
            contents: Contents::default(),
            first: None,
            done: false,
        };
        let first = reader.advance();
        if first.is_ok() {
            reader.add_summary()?;
        }
        let is_cut = matches!(first, Err(RecordingError::Cut { .. }));
        match first {
            Err(error) if !is_cut => return Err(error),
            _ if length < mcap::MAGIC.len() as u64 => return Err(RecordingError::foreign(path, ForeignFile::NotMcap)),
            _ if reader.contents.topics.is_empty() && !is_cut => {
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

    /// Channels found so far: all, unless the file is truncated, or was written by another program without a summary.
    pub fn topics(&self) -> &[RecordedTopic] {
        &self.contents.topics
    }

    /// Notes of the recorder about the run.
    pub fn about(&self) -> &BTreeMap<String, String> {
        &self.contents.about
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
        let Contents { topics, data, .. } = &self.contents;
        let Some(envelope) = envelope_of(data) else { return Ok(None) };
        Ok(Some(Recorded { topic: &topics[index], index, envelope, bytes: data }))
    }

    /// An error at the current position.
    pub(super) fn damaged(&self, fault: RecordFault) -> RecordingError {
        RecordingError::Damaged { path: self.path.clone(), offset: self.length - self.remaining, fault }
    }

    /// Adds the channels of the summary that are not declared before the first message.
    fn add_summary(&mut self) -> Result<(), RecordingError> {
        let records = summary::read(&self.path, self.length, MAX_RECORD as u64);
        let records = records.map_err(|cause| RecordingError::io(&self.path, cause))?;
        let mut records = Chunk::from_records(records.unwrap_or_default());
        while let Some((opcode, body)) = records.next().map_err(|fault| self.damaged(fault))? {
            if [op::SCHEMA, op::CHANNEL].contains(&opcode) {
                self.contents.add(opcode, body).map_err(|fault| self.damaged(fault))?;
            }
        }
        Ok(())
    }

    /// Reads the next message of a known topic into `contents`. Returns the index of the topic.
    fn advance(&mut self) -> Result<Option<usize>, RecordingError> {
        loop {
            let cut = RecordingError::Cut { path: self.path.clone(), offset: self.length, whole: self.whole };
            let offset = self.length - self.remaining;
            let damaged = |fault: RecordFault| RecordingError::Damaged { path: self.path.clone(), offset, fault };
            if let Some((opcode, body)) = self.chunk.next().map_err(damaged)? {
                match self.contents.add(opcode, body).map_err(damaged)? {
                    Some(index) => return Ok(Some(index)),
                    None => continue,
                }
            }
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
                    if opcode == op::CHUNK {
                        self.chunk.open(data, &mut self.limit).map_err(damaged)?;
                    } else if let Some(index) = self.contents.add(opcode, data).map_err(damaged)? {
                        return Ok(Some(index));
                    }
                }
            }
        }
    }
}
