//! A message in the memory of this process, from a test or a saved state.

use messages::pod::zeroed_rows;
use messages::{Envelope, Message};

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
