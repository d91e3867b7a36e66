//! A message before and after its way, whatever the way is.

use crate::Iox;
use crate::copying::{OwnLoan, OwnMessage};
use crate::loan::{CacheLine, SharedLoan, WireEnvelope, view};
use iceoryx2::sample::Sample;
use messages::{Envelope, Message, Pod};

/// A message under construction: in the shared memory in which its consumers will read it, unless the channel copies.
pub struct Loan<T: Message>(pub(crate) LoanMemory<T>);

pub(crate) enum LoanMemory<T: Message> {
    Shared(SharedLoan<T>),
    Own(OwnLoan<T>),
}

impl<T: Message> Loan<T> {
    /// Rows that fit.
    pub fn capacity(&self) -> usize {
        match &self.0 {
            LoanMemory::Shared(loan) => loan.capacity(),
            LoanMemory::Own(loan) => loan.capacity(),
        }
    }
    /// Rows written so far.
    pub fn rows(&self) -> &[T::Row] {
        match &self.0 {
            LoanMemory::Shared(loan) => loan.rows(),
            LoanMemory::Own(loan) => loan.rows(),
        }
    }
    /// The fixed part.
    pub fn header_mut(&mut self) -> &mut T::Header {
        match &mut self.0 {
            LoanMemory::Shared(loan) => loan.header_mut(),
            LoanMemory::Own(loan) => loan.header_mut(),
        }
    }
    /// Appends `n` zeroed rows and lends them for writing. `None` if they do not fit.
    pub fn grow(&mut self, n: usize) -> Option<&mut [T::Row]> {
        let rows = self.reserve(n)?;
        rows.fill(T::Row::zeroed());
        Some(rows)
    }
    /// Appends `n` rows, each made from its place among them; nothing is written twice. `None` if they do not fit.
    pub fn grow_with(&mut self, n: usize, row: impl FnMut(usize) -> T::Row) -> Option<&mut [T::Row]> {
        let rows = self.reserve(n)?;
        rows.iter_mut().zip((0..n).map(row)).for_each(|(place, row)| *place = row);
        Some(rows)
    }
    /// Appends copies of `new_rows`; nothing is written twice. `None` if they do not fit.
    #[must_use = "rows that do not fit are not written"]
    pub fn extend_from_slice(&mut self, new_rows: &[T::Row]) -> Option<()> {
        self.reserve(new_rows.len())?.copy_from_slice(new_rows);
        Some(())
    }
    /// Appends `n` rows with whatever an earlier message has left in them, for callers that write every one: 100 MB need
    /// not be written twice. `None` if they do not fit.
    pub fn grow_unset(&mut self, n: usize) -> Option<&mut [T::Row]> {
        self.reserve(n)
    }
    fn reserve(&mut self, n: usize) -> Option<&mut [T::Row]> {
        match &mut self.0 {
            LoanMemory::Shared(loan) => loan.reserve(n),
            LoanMemory::Own(loan) => loan.reserve(n),
        }
    }
}

/// A message that has come. In shared memory it stays readable after its producer's death.
pub struct Received<T: Message>(pub(crate) ReceivedMemory<T>);

pub(crate) enum ReceivedMemory<T: Message> {
    Shared(Sample<Iox, [CacheLine], WireEnvelope>),
    Own(OwnMessage<T>),
}

impl<T: Message> Received<T> {
    /// The envelope.
    pub fn envelope(&self) -> &Envelope {
        match &self.0 {
            ReceivedMemory::Shared(sample) => &sample.user_header().0,
            ReceivedMemory::Own(message) => &message.envelope,
        }
    }
    fn view(&self) -> (&T::Header, &[T::Row]) {
        match &self.0 {
            ReceivedMemory::Shared(sample) => {
                let len = sample.user_header().0.len as usize;
                view::<T>(sample.payload(), len).expect("`Subscriber::receive` passes on only what fits")
            }
            ReceivedMemory::Own(message) => (&message.header, &message.rows),
        }
    }
    /// The fixed part.
    pub fn header(&self) -> &T::Header {
        self.view().0
    }
    /// The rows, in place.
    pub fn rows(&self) -> &[T::Row] {
        self.view().1
    }
}
