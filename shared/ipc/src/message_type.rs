//! The sizes of a message type. With these as values instead of a type parameter, shared memory and credits are
//! compiled once, in this crate, and not in every program.

use crate::slot::{LINE, header_lines};
use messages::Message;

/// A type of messages, as values.
#[derive(Clone, Copy)]
pub(crate) struct MessageType {
    pub(crate) version: u32,
    pub(crate) layout: u64,
    pub(crate) row_bytes: usize,
    pub(crate) max_rows: usize,
    header_lines: usize,
}

impl MessageType {
    pub(crate) fn of<T: Message>() -> Self {
        Self {
            version: T::VERSION,
            layout: T::LAYOUT,
            row_bytes: size_of::<T::Row>(),
            max_rows: T::MAX_ROWS,
            header_lines: header_lines::<T>(),
        }
    }

    /// Lines of a slot for `n_rows`.
    pub(crate) fn lines_for(&self, n_rows: usize) -> usize {
        self.header_lines + (n_rows * self.row_bytes).div_ceil(LINE)
    }

    /// Whether a slot of `n_lines` holds the header and `n_rows`.
    pub(crate) fn fits(&self, n_lines: usize, n_rows: usize) -> bool {
        let row_lines = n_lines.checked_sub(self.header_lines);
        let bytes = n_rows.checked_mul(self.row_bytes);
        row_lines.zip(bytes).is_some_and(|(lines, bytes)| bytes <= lines * LINE)
    }
}
