//! A message in memory of this process: of a test, a saved state or a socket.

use messages::pod::{bytes_from_rows_mut, zeroed_rows};
use messages::{Envelope, Message};
use std::any::Any;

/// A message under construction.
pub(crate) struct OwnLoan<T: Message> {
    header: Box<T::Header>,
    rows: Vec<T::Row>,
    len: usize,
}

impl<T: Message> OwnLoan<T> {
    pub(crate) fn new(capacity: usize) -> Self {
        Self { header: Box::default(), rows: zeroed_rows(capacity), len: 0 }
    }
    pub(crate) fn capacity(&self) -> usize {
        self.rows.len()
    }
    pub(crate) fn rows(&self) -> &[T::Row] {
        &self.rows[..self.len]
    }
    pub(crate) fn rows_mut(&mut self) -> &mut [T::Row] {
        &mut self.rows[..self.len]
    }
    pub(crate) fn header_mut(&mut self) -> &mut T::Header {
        &mut self.header
    }
    pub(crate) fn append(&mut self, n: usize) -> Option<&mut [T::Row]> {
        let start = self.len;
        let rows = self.rows[start..].get_mut(..n)?;
        self.len += n;
        Some(rows)
    }
    pub(crate) fn finish(mut self, mut envelope: Envelope) -> OwnMessage<T> {
        envelope.len = self.len as u32;
        self.rows.truncate(self.len);
        OwnMessage { envelope, header: self.header, rows: self.rows }
    }
}

/// A complete message.
pub(crate) struct OwnMessage<T: Message> {
    pub(crate) envelope: Envelope,
    pub(crate) header: Box<T::Header>,
    pub(crate) rows: Vec<T::Row>,
}

impl<T: Message> OwnMessage<T> {
    pub(crate) fn zeroed(envelope: Envelope) -> Self {
        Self { envelope, header: Box::default(), rows: zeroed_rows(envelope.len as usize) }
    }
}

/// An [`OwnMessage`] of a type that only its receiver knows.
pub(crate) trait AnyOwnMessage: Send {
    fn envelope(&self) -> &Envelope;
    /// Header and rows.
    fn bytes_mut(&mut self) -> [&mut [u8]; 2];
    fn into_any(self: Box<Self>) -> Box<dyn Any>;
}

impl<T: Message> AnyOwnMessage for OwnMessage<T> {
    fn envelope(&self) -> &Envelope {
        &self.envelope
    }
    fn bytes_mut(&mut self) -> [&mut [u8]; 2] {
        let header = std::slice::from_mut(&mut *self.header);
        [bytes_from_rows_mut(header), bytes_from_rows_mut(&mut self.rows)]
    }
    fn into_any(self: Box<Self>) -> Box<dyn Any> {
        self
    }
}
