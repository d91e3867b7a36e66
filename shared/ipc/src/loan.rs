//! The memory of one message, while it is written.
//!
//! A slot is a run of cache lines: first the header, padded to whole lines, then the rows.
//!
//! | line | content |
//! |---|---|
//! | 0 .. `header_lines` | `T::Header`, rest zero |
//! | `header_lines` .. | rows of `T::Row`, without gaps |

#![allow(unsafe_code, reason = "reads and writes shared memory as typed rows; each block states why it may")]

use crate::publisher::MAX_LOANS;
use crate::{Iox, IpcError};
use iceoryx2::port::LoanError;
use iceoryx2::prelude::*;
use iceoryx2::sample_mut::SampleMut;
use messages::{Envelope, Message};
use std::marker::PhantomData;

/// 64 bytes, so that headers and rows start on a cache line whatever their type.
#[derive(Clone, Copy)]
#[repr(C)]
#[repr(align(64))]
pub(crate) struct CacheLine([u8; LINE]);

/// Bytes of a [`CacheLine`].
pub(crate) const LINE: usize = 64;

impl std::fmt::Debug for CacheLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("CacheLine")
    }
}

// SAFETY: plain bytes with a fixed layout: self-contained, no pointers, the same in every process.
unsafe impl ZeroCopySend for CacheLine {
    unsafe fn type_name() -> &'static str {
        "replica.CacheLine.v1"
    }
}

/// The envelope as iceoryx2's user header.
#[derive(Clone, Copy, Debug, Default)]
#[repr(transparent)]
pub(crate) struct WireEnvelope(pub(crate) Envelope);

// SAFETY: transparent over a `Pod`: `repr(C)`, self-contained, no pointers.
unsafe impl ZeroCopySend for WireEnvelope {
    unsafe fn type_name() -> &'static str {
        "replica.Envelope.v1"
    }
}

/// Lines that the header takes.
pub(crate) const fn header_lines<T: Message>() -> usize {
    const { assert!(align_of::<T::Header>() <= LINE && align_of::<T::Row>() <= LINE && size_of::<T::Row>() > 0) };
    const { assert!(T::MAX_ROWS <= u32::MAX as usize, "the envelope counts rows in 32 bits") };
    size_of::<T::Header>().div_ceil(LINE)
}

/// Lines of a slot for `n_rows`.
pub(crate) fn lines_for<T: Message>(n_rows: usize) -> usize {
    // A slot is never empty: iceoryx2 has no slices of length zero to lend.
    (header_lines::<T>() + (n_rows * size_of::<T::Row>()).div_ceil(LINE)).max(1)
}

/// The bytes of a slot.
pub(crate) fn bytes_of_lines(lines: &[CacheLine]) -> &[u8] {
    // SAFETY: a cache line is 64 bytes without padding, all of them initialised (see `Loan::new`); u8 has no alignment.
    unsafe { std::slice::from_raw_parts(lines.as_ptr().cast(), size_of_val(lines)) }
}

/// The header and `len` rows of a slot; `None` if it is too short for them.
pub(crate) fn view<T: Message>(lines: &[CacheLine], len: usize) -> Option<(&T::Header, &[T::Row])> {
    let rows_at = header_lines::<T>();
    if lines.len() < rows_at || rows_capacity::<T>(lines.len()) < len {
        return None;
    }
    // SAFETY: the first `header_lines` lines exist and hold a `T::Header`, which is `Pod` (any bytes are valid) and
    // needs no more than a cache line's alignment; the lifetime is that of `lines`.
    let header = unsafe { &*lines.as_ptr().cast::<T::Header>() };
    // SAFETY: `len` rows fit behind the header (checked above), a line's alignment is enough for a row (asserted in
    // `header_lines`), any bytes are valid rows, and the lifetime is that of `lines`.
    let rows = unsafe { std::slice::from_raw_parts(lines.as_ptr().add(rows_at).cast::<T::Row>(), len) };
    Some((header, rows))
}

fn rows_capacity<T: Message>(n_lines: usize) -> usize {
    n_lines.saturating_sub(header_lines::<T>()) * LINE / size_of::<T::Row>()
}

/// A message under construction, in the shared memory in which its consumers will read it.
pub(crate) struct SharedLoan<T: Message> {
    sample: SampleMut<Iox, [CacheLine], WireEnvelope>,
    len: usize,
    capacity: usize,
    message: PhantomData<T>,
}

impl<T: Message> SharedLoan<T> {
    pub(crate) fn new(
        publisher: &iceoryx2::port::publisher::Publisher<Iox, [CacheLine], WireEnvelope>,
        capacity: usize,
    ) -> Result<Self, IpcError> {
        let sample = publisher.loan_slice_uninit(lines_for::<T>(capacity)).map_err(|cause| {
            let what = format!("loan of {capacity} rows ({} bytes each)", size_of::<T::Row>());
            match cause {
                LoanError::ExceedsMaxLoans => {
                    IpcError::transport(what, format_args!("a stage may hold {MAX_LOANS} loans of a topic at a time"))
                }
                other => IpcError::transport(what, other),
            }
        })?;
        // SAFETY: the slot lies in mapped shared memory, whose bytes the operating system has initialised (zero, or what
        // an earlier message left), and any bytes are a valid `CacheLine`.
        let sample = unsafe { sample.assume_init() };
        let mut loan = Self { sample, len: 0, capacity, message: PhantomData };
        *loan.header_mut() = T::Header::default();
        Ok(loan)
    }
    /// Rows that fit.
    pub(crate) fn capacity(&self) -> usize {
        self.capacity
    }
    /// Rows written so far.
    pub(crate) fn rows(&self) -> &[T::Row] {
        view::<T>(self.sample.payload(), self.len).map_or(&[], |(_, rows)| rows)
    }
    /// The fixed part.
    pub(crate) fn header_mut(&mut self) -> &mut T::Header {
        // SAFETY: as in `view`; a loan has at least `header_lines` lines (or the header has size zero), and the
        // exclusive borrow of the sample passes on.
        unsafe { &mut *self.sample.payload_mut().as_mut_ptr().cast::<T::Header>() }
    }
    /// Appends `n` rows of whatever content and lends them for writing. `None` if they do not fit.
    pub(crate) fn reserve(&mut self, n: usize) -> Option<&mut [T::Row]> {
        if n > self.capacity - self.len {
            return None;
        }
        let start = self.len;
        self.len += n;
        let rows_at = header_lines::<T>();
        // SAFETY: rows `start .. start + n` lie within the slot (`lines_for(capacity)` lines were loaned), are aligned
        // (asserted in `header_lines`) and exclusively ours; any bytes are valid rows.
        Some(unsafe {
            let first = self.sample.payload_mut().as_mut_ptr().add(rows_at).cast::<T::Row>().add(start);
            std::slice::from_raw_parts_mut(first, n)
        })
    }
    pub(crate) fn finish(mut self, mut envelope: Envelope) -> SampleMut<Iox, [CacheLine], WireEnvelope> {
        envelope.len = self.len as u32;
        *self.sample.user_header_mut() = WireEnvelope(envelope);
        self.sample
    }
}
