//! Requests and answers as bytes: a head (postcard) behind its length (u32, little-endian), then the blocks whose
//! lengths are in the head. The version of the link covers them
//! ([`link::channel::VERSION`](../../../link/channel/constant.VERSION.html)).

use crate::{Context, Outputs, Problem, StepError};
use run::Change;
use run::assignment::Description;
use run::health::ReportedDoubt;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::collections::BTreeMap;
use std::io::{Error, ErrorKind, Read, Write};

/// Largest head. A head has texts of a launch file, or lengths of the messages of a tick.
const MAX_HEAD_BYTES: u32 = 16 << 20;

/// The text of a launch file, independent of its path.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct LaunchText {
    pub(super) text: String,
    pub(super) changes: Vec<Change>,
    /// Table of the stage.
    pub(super) table: String,
}

/// The requests of the run. A successful answer ends with the message in parentheses.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Request {
    /// Topics and settings ([`Answer::Described`]).
    Describe(LaunchText),
    /// Problems of the settings ([`Answer::Problems`]).
    Check(LaunchText, Context),
    /// Builds the stage ([`Answer::Done`]).
    Open(LaunchText, Context),
    /// Loads a state of this many bytes, which follow ([`Answer::Done`]).
    Load(u64),
    /// One tick; its messages follow ([`Answer::Done`]).
    Step(Report, Vec<MessageBlock>),
    /// The end of the drive ([`Answer::Done`]).
    Finish(Report),
    /// The state at a barrier ([`Answer::State`]).
    Save,
}

/// A message of a request: envelope, header and rows.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct MessageBlock {
    pub(super) topic: String,
    pub(super) n_bytes: u64,
}

/// The answers of the program.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Answer {
    /// The program works on the request; the number rises with its progress.
    Alive(u64),
    Described(Description),
    Problems(Vec<Problem>),
    /// Counters, notes and doubts after a step, before its messages.
    Reported(Report),
    /// A published message; its header and rows follow.
    Message {
        topic: String,
        stamp: i64,
        /// The submap of a column.
        column: Option<u64>,
        n_rows: u64,
    },
    /// Bytes of a state and of a row, for each piece; the pieces follow.
    State(Vec<(u64, u64)>),
    Done,
    /// The stage failed with a [`StepError`].
    Failed(Failure, String),
}

/// The kinds of [`StepError`] that another process can report.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) enum Failure {
    Data,
    Io,
    Contract,
    Configuration,
}

impl Failure {
    pub(super) fn from_error(error: &StepError) -> Self {
        match error {
            StepError::Data(_) => Self::Data,
            StepError::Io(_) | StepError::Stopped { .. } | StepError::Ipc(_) => Self::Io,
            StepError::Contract(_) => Self::Contract,
            StepError::Configuration(_) => Self::Configuration,
        }
    }

    pub(super) fn error(self, text: String) -> StepError {
        match self {
            Self::Data => StepError::data(text),
            Self::Io => StepError::io(text),
            Self::Contract => StepError::contract(text),
            Self::Configuration => StepError::configuration(text),
        }
    }
}

/// What a stage has reported since the start of the drive.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Report {
    counters: BTreeMap<String, u64>,
    notes: Vec<String>,
    doubts: Vec<ReportedDoubt>,
}

impl Report {
    pub(super) fn from_outputs(outputs: &Outputs) -> Self {
        Self { counters: outputs.counters.clone(), notes: outputs.notes.clone(), doubts: outputs.doubts.clone() }
    }

    pub(super) fn replace(self, outputs: &mut Outputs) {
        outputs.counters = self.counters;
        outputs.notes = self.notes;
        outputs.doubts = self.doubts;
    }
}

/// Writes a head. Blocks and a flush may follow.
pub(super) fn write_head(writer: &mut dyn Write, head: &impl Serialize) -> std::io::Result<()> {
    let bytes = postcard::to_stdvec(head).map_err(Error::other)?;
    writer.write_all(&(bytes.len() as u32).to_le_bytes())?;
    writer.write_all(&bytes)
}

/// Reads a head. [`ErrorKind::UnexpectedEof`]: the other end has closed the stream.
pub(super) fn read_head<T: DeserializeOwned>(reader: &mut dyn Read) -> std::io::Result<T> {
    let mut len = [0; 4];
    reader.read_exact(&mut len)?;
    let len = u32::from_le_bytes(len);
    if len > MAX_HEAD_BYTES {
        return Err(Error::new(
            ErrorKind::InvalidData,
            format!("head of {len} bytes; up to {MAX_HEAD_BYTES} are allowed"),
        ));
    }
    let bytes = read_block(reader, u64::from(len))?;
    postcard::from_bytes(&bytes).map_err(|error| Error::new(ErrorKind::InvalidData, error))
}

/// Reads a block. Memory grows with the bytes that arrive, not with the announced length.
pub(super) fn read_block(reader: &mut dyn Read, n_bytes: u64) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let n_read = reader.take(n_bytes).read_to_end(&mut bytes)?;
    if n_read as u64 == n_bytes { Ok(bytes) } else { Err(ErrorKind::UnexpectedEof.into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn head_and_block_are_read_as_written() {
        let mut bytes = Vec::new();
        write_head(&mut bytes, &Request::Load(3)).expect("written");
        bytes.extend(b"abcd");
        let mut reader = &bytes[..];
        assert!(matches!(read_head(&mut reader), Ok(Request::Load(3))));
        assert_eq!(read_block(&mut reader, 3).expect("a block"), b"abc");
        assert_eq!(reader, b"d");
    }

    #[test]
    fn cut_or_foreign_bytes_are_errors() {
        let mut bytes = Vec::new();
        let report = Report { notes: vec!["a note".to_owned()], ..Report::default() };
        write_head(&mut bytes, &Request::Finish(report)).expect("written");
        for len in 0..bytes.len() {
            let error = read_head::<Request>(&mut &bytes[..len]).expect_err("cut");
            assert_eq!(error.kind(), ErrorKind::UnexpectedEof, "{len} bytes");
        }
        let too_long = u32::MAX.to_le_bytes();
        assert_eq!(read_head::<Request>(&mut &too_long[..]).expect_err("refused").kind(), ErrorKind::InvalidData);
        let unknown = [1, 0, 0, 0, 99];
        assert_eq!(read_head::<Request>(&mut &unknown[..]).expect_err("refused").kind(), ErrorKind::InvalidData);
        assert_eq!(read_block(&mut &b"ab"[..], u64::MAX).expect_err("cut").kind(), ErrorKind::UnexpectedEof);
    }
}
