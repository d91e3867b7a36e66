//! A stage's state: its own part, then messages as they are.

use crate::state::{decode_state, encode_state};
use crate::{Received, StateError, StepError};
use messages::Message;
use run::Piece;
use serde::{Serialize, de::DeserializeOwned};
use std::borrow::Cow;
use std::path::PathBuf;

/// The result of [`crate::Stage::save`]: bytes in consecutive pieces. A message that the stage holds is one piece. It
/// is written from shared memory without a copy, because a window of images has hundreds of megabytes.
#[derive(Debug, Default)]
pub struct StateBytes<'a> {
    /// Pieces, each with the bytes of a row.
    pieces: Vec<(Cow<'a, [u8]>, usize)>,
    files: Vec<PathBuf>,
}

impl From<Vec<u8>> for StateBytes<'_> {
    fn from(bytes: Vec<u8>) -> Self {
        Self { pieces: vec![(bytes.into(), 1)], files: Vec::new() }
    }
}

impl<'a> StateBytes<'a> {
    /// A state of these pieces, each with the bytes of a row.
    pub(crate) fn from_pieces(pieces: Vec<(Vec<u8>, usize)>) -> Self {
        let pieces = pieces.into_iter().map(|(bytes, row_bytes)| (bytes.into(), row_bytes)).collect();
        Self { pieces, files: Vec::new() }
    }
    /// A state whose messages follow `head`: [`encode_state`] behind its length (u32, little-endian). [`decode_head`] is the inverse.
    pub fn with_head<S: Serialize>(version: u32, head: &S) -> Result<Self, StateError> {
        let head = encode_state(version, head)?;
        let len = (head.len() as u32).to_le_bytes();
        Ok(Self::from([&len[..], &head].concat()))
    }
    /// Appends a message. [`next_message`] is the inverse.
    pub fn push<T: Message>(&mut self, message: &'a Received<T>) {
        let [envelope, header, rows] = message.parts();
        self.pieces.extend([envelope, header].map(|bytes| (Cow::Borrowed(bytes), 1)));
        self.push_rows(rows, size_of::<T::Row>());
    }
    /// Appends rows of `row_bytes` without a copy.
    pub fn push_rows(&mut self, rows: &'a [u8], row_bytes: usize) {
        self.pieces.push((Cow::Borrowed(rows), row_bytes));
    }
    /// Files that the state refers to. They are synced to the disk before the state counts as saved.
    pub fn rely_on(&mut self, files: impl IntoIterator<Item = PathBuf>) {
        self.files.extend(files);
    }
    /// The files of [`StateBytes::rely_on`].
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }
    /// The pieces in their order.
    pub fn pieces(&self) -> impl Iterator<Item = Piece<'_>> {
        self.pieces.iter().map(|(bytes, row_bytes)| Piece { bytes, row_bytes: *row_bytes })
    }
    /// All pieces in one.
    pub fn to_vec(&self) -> Vec<u8> {
        self.pieces().map(|piece| piece.bytes).collect::<Vec<_>>().concat()
    }
}

/// The head of [`StateBytes::with_head`], and the bytes of the messages after it.
pub fn decode_head<S: DeserializeOwned>(version: u32, state: &[u8]) -> Result<(S, &[u8]), StateError> {
    let foreign = || StateError::Foreign(state.len());
    let (len, rest) = state.split_first_chunk::<4>().ok_or_else(foreign)?;
    let (head, messages) = rest.split_at_checked(u32::from_le_bytes(*len) as usize).ok_or_else(foreign)?;
    Ok((decode_state(version, head)?, messages))
}

/// Takes the first message of `bytes`.
pub fn next_message<T: Message>(bytes: &mut &[u8]) -> Result<Received<T>, StepError> {
    Ok(Received::take_from(bytes)?)
}
