//! A stage's state: a part of its own, then messages as they are.

use super::{StateError, decode_state, encode_state};
use crate::{Received, StepError};
use messages::{Envelope, Message, Pod, pod};
use serde::{Serialize, de::DeserializeOwned};
use std::borrow::Cow;
use std::path::PathBuf;

/// What [`crate::Stage::save`] returns: bytes in pieces, one behind the other. A message that the stage holds is a piece that is
/// written from where it lies, because a window of images has hundreds of megabytes.
#[derive(Debug, Default)]
pub struct StateBytes<'a> {
    pieces: Vec<Cow<'a, [u8]>>,
    files: Vec<PathBuf>,
}

impl From<Vec<u8>> for StateBytes<'_> {
    fn from(bytes: Vec<u8>) -> Self {
        Self { pieces: vec![bytes.into()], files: Vec::new() }
    }
}

impl<'a> StateBytes<'a> {
    /// A state whose messages follow `head`: [`encode_state`] behind its length (u32, little-endian). [`decode_head`] is the inverse.
    pub fn with_head<S: Serialize>(version: u32, head: &S) -> Result<Self, StateError> {
        let head = encode_state(version, head)?;
        Ok(Self { pieces: vec![(head.len() as u32).to_le_bytes().to_vec().into(), head.into()], files: Vec::new() })
    }
    /// Appends a message. [`next_message`] is the inverse.
    pub fn push<T: Message>(&mut self, message: &'a Received<T>) {
        self.pieces.extend(message.parts().map(Cow::Borrowed));
    }
    /// Appends bytes from where they lie.
    pub fn push_bytes(&mut self, bytes: &'a [u8]) {
        self.pieces.push(Cow::Borrowed(bytes));
    }
    /// Files that the state speaks of. They are brought to the disk before it counts as saved.
    pub fn rely_on(&mut self, files: impl IntoIterator<Item = PathBuf>) {
        self.files.extend(files);
    }
    /// What was given to [`StateBytes::rely_on`].
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }
    /// The pieces in their order.
    pub fn pieces(&self) -> impl Iterator<Item = &[u8]> {
        self.pieces.iter().map(|piece| &**piece)
    }
    /// All pieces in one.
    pub fn to_vec(&self) -> Vec<u8> {
        self.pieces.concat()
    }
}

/// What [`StateBytes::with_head`] was given, and the bytes of the messages behind it.
pub fn decode_head<S: DeserializeOwned>(version: u32, state: &[u8]) -> Result<(S, &[u8]), StateError> {
    let foreign = || StateError::Foreign(state.len());
    let (len, rest) = state.split_first_chunk::<4>().ok_or_else(foreign)?;
    let (head, messages) = rest.split_at_checked(u32::from_le_bytes(*len) as usize).ok_or_else(foreign)?;
    Ok((decode_state(version, head)?, messages))
}

/// Takes the first message of `bytes`.
pub fn next_message<T: Message>(bytes: &mut &[u8]) -> Result<Received<T>, StepError> {
    let n_bytes = bytes.len();
    let cut = || StepError::data(format!("saved {} message: the {n_bytes} bytes left do not hold it", T::TOPIC));
    let envelope: Envelope = rows(bytes, 1).ok_or_else(cut)?[0];
    let header: T::Header = rows(bytes, 1).ok_or_else(cut)?[0];
    let rows = rows(bytes, envelope.len as usize).ok_or_else(cut)?;
    Ok(Received::owned(envelope, header, rows))
}

/// `n` rows, if there are so many.
fn rows<R: Pod>(bytes: &mut &[u8], n: usize) -> Option<Vec<R>> {
    let (taken, rest) = bytes.split_at_checked(n.checked_mul(size_of::<R>())?)?;
    *bytes = rest;
    pod::rows_from_bytes(taken)
}
