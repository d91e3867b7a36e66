//! A message before and after its transport.

use crate::LoanFull;
use crate::own_memory::{OwnLoan, OwnMessage};
use crate::slot::{ReceivedSlot, SharedLoan, view};
use messages::pod::bytes_from_rows;
use messages::{Envelope, Message};

/// A message under construction, in the shared memory in which its consumers will read it; in tests and in a stage that
/// runs alone, in the memory of this process. May be kept over several steps.
pub struct Loan<T: Message>(pub(crate) LoanMemory<T>);

pub(crate) enum LoanMemory<T: Message> {
    Shared(SharedLoan<T>),
    Own(OwnLoan<T>),
}

impl<T: Message> Loan<T> {
    /// A loan in the memory of this process, for at most `capacity` rows.
    pub fn in_own_memory(capacity: usize) -> Self {
        Self(LoanMemory::Own(OwnLoan::new(capacity)))
    }
    /// The complete message of a loan that [`Loan::in_own_memory`] made; `None` for a loan in shared memory.
    pub fn into_received(self, envelope: Envelope) -> Option<Received<T>> {
        match self.0 {
            LoanMemory::Own(loan) => Some(Received(ReceivedMemory::Own(loan.finish(envelope)))),
            LoanMemory::Shared(_) => None,
        }
    }
    /// Largest number of rows.
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
    /// Rows written so far, to change them.
    pub fn rows_mut(&mut self) -> &mut [T::Row] {
        match &mut self.0 {
            LoanMemory::Shared(loan) => loan.rows_mut(),
            LoanMemory::Own(loan) => loan.rows_mut(),
        }
    }
    /// The fixed part, zero at first.
    pub fn header_mut(&mut self) -> &mut T::Header {
        match &mut self.0 {
            LoanMemory::Shared(loan) => loan.header_mut(),
            LoanMemory::Own(loan) => loan.header_mut(),
        }
    }
    /// Appends `n` zeroed rows and returns them for writing.
    pub fn grow(&mut self, n: usize) -> Result<&mut [T::Row], LoanFull> {
        let rows = self.append(n)?;
        rows.fill(bytemuck::Zeroable::zeroed());
        Ok(rows)
    }
    /// Appends `n` rows, each made from its index among them. Every row is written once.
    pub fn grow_with(&mut self, n: usize, row: impl FnMut(usize) -> T::Row) -> Result<&mut [T::Row], LoanFull> {
        let rows = self.append(n)?;
        rows.iter_mut().zip((0..n).map(row)).for_each(|(place, row)| *place = row);
        Ok(rows)
    }
    /// Appends copies of `new_rows`. Every row is written once.
    pub fn extend_from_slice(&mut self, new_rows: &[T::Row]) -> Result<(), LoanFull> {
        self.append(new_rows.len())?.copy_from_slice(new_rows);
        Ok(())
    }
    /// Appends `n` rows that contain the bytes of an earlier message, at half the cost of [`Loan::grow`]. Write every
    /// row: otherwise the result depends on the earlier message.
    pub fn grow_unset(&mut self, n: usize) -> Result<&mut [T::Row], LoanFull> {
        self.append(n)
    }
    fn append(&mut self, n: usize) -> Result<&mut [T::Row], LoanFull> {
        let full = LoanFull { topic: T::TOPIC, capacity: self.capacity(), used: self.rows().len(), requested: n };
        let rows = match &mut self.0 {
            LoanMemory::Shared(loan) => loan.append(n),
            LoanMemory::Own(loan) => loan.append(n),
        };
        rows.ok_or(full)
    }
}

/// A message that a stage may read, and keep for later steps (at most [`Message::BORROWED`] at a time). In shared memory it
/// stays readable after its producer has ended.
pub struct Received<T: Message>(pub(crate) ReceivedMemory<T>);

pub(crate) enum ReceivedMemory<T: Message> {
    /// A message in shared memory, where its producer wrote it.
    Shared(ReceivedSlot),
    Own(OwnMessage<T>),
}

impl<T: Message> Received<T> {
    /// A message in the memory of this process.
    pub fn in_own_memory(envelope: Envelope, header: T::Header, rows: Vec<T::Row>) -> Self {
        Self(ReceivedMemory::Own(OwnMessage { envelope, header: Box::new(header), rows }))
    }
    /// The envelope.
    pub fn envelope(&self) -> &Envelope {
        match &self.0 {
            ReceivedMemory::Shared(slot) => slot.envelope(),
            ReceivedMemory::Own(message) => &message.envelope,
        }
    }
    /// Sequence number of the message on its topic; of a column, the number of its submap.
    pub fn seq(&self) -> u64 {
        self.envelope().seq
    }
    /// Nanoseconds since the Unix epoch.
    pub fn stamp(&self) -> i64 {
        self.envelope().stamp
    }
    fn view(&self) -> (&T::Header, &[T::Row]) {
        match &self.0 {
            ReceivedMemory::Shared(slot) => {
                let (envelope, lines) = slot.content();
                view::<T>(lines, envelope.len as usize)
                    .expect("`Subscriber::receive` returns only messages that fit their slot")
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
    /// Envelope, header and rows as bytes, in place.
    pub fn parts(&self) -> [&[u8]; 3] {
        let (header, rows) = self.view();
        [
            bytes_from_rows(std::slice::from_ref(self.envelope())),
            bytes_from_rows(std::slice::from_ref(header)),
            bytes_from_rows(rows),
        ]
    }
    /// A copy of the whole message as bytes, for a saved state.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.parts().concat()
    }
    /// The inverse of [`Received::to_bytes`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SavedMessageError> {
        let mut rest = bytes;
        let message = Self::take_from(&mut rest)?;
        let n_bytes = rest.len();
        if n_bytes == 0 { Ok(message) } else { Err(SavedMessageError::Trailing { topic: T::TOPIC, n_bytes }) }
    }
    /// Takes the message at the start of `bytes`.
    pub fn take_from(bytes: &mut &[u8]) -> Result<Self, SavedMessageError> {
        let cut = SavedMessageError::Cut { topic: T::TOPIC, n_bytes: bytes.len() };
        take(bytes).ok_or(cut)
    }
}

fn take<T: Message>(bytes: &mut &[u8]) -> Option<Received<T>> {
    let envelope: Envelope = take_rows(bytes, 1)?[0];
    let header: T::Header = take_rows(bytes, 1)?[0];
    let rows = take_rows(bytes, envelope.len as usize)?;
    Some(Received::in_own_memory(envelope, header, rows))
}

/// Takes `n` rows, if `bytes` has so many.
fn take_rows<R: messages::Pod>(bytes: &mut &[u8], n: usize) -> Option<Vec<R>> {
    let (taken, rest) = bytes.split_at_checked(n.checked_mul(size_of::<R>())?)?;
    *bytes = rest;
    messages::pod::rows_from_bytes(taken)
}

/// Bytes that are not a message of the expected topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SavedMessageError {
    /// The bytes are too few for the header, or for the rows that the envelope states.
    #[error("saved {topic} message: the {n_bytes} bytes left do not hold it")]
    Cut {
        /// The expected topic.
        topic: &'static str,
        /// Number of bytes.
        n_bytes: usize,
    },
    /// The bytes are more than the envelope states.
    #[error("saved {topic} message: {n_bytes} bytes follow its rows")]
    Trailing {
        /// The expected topic.
        topic: &'static str,
        /// Bytes after the rows.
        n_bytes: usize,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{ClassRow, ClassTopic};

    fn message() -> Received<ClassTopic> {
        let mut loan = Loan::<ClassTopic>::in_own_memory(5);
        loan.header_mut().model_digest = 9;
        loan.grow(2).expect("fits")[1].class_id = 4;
        loan.extend_from_slice(&[ClassRow { class_id: 7, score: 1 }]).expect("fits");
        loan.into_received(Envelope { seq: 3, stamp: -1, ..Envelope::default() }).expect("in own memory")
    }

    #[test]
    fn full_loan_reports_topic_and_rows() {
        let mut loan = Loan::<ClassTopic>::in_own_memory(5);
        loan.grow_with(3, |i| ClassRow { class_id: i as u8, score: 0 }).expect("fits");
        let error = loan.grow(3).expect_err("2 are left").to_string();
        assert_eq!(error, "class: 3 more rows do not fit a loan of 5 rows with 3 written");
        assert_eq!(loan.rows().iter().map(|row| row.class_id).collect::<Vec<_>>(), [0, 1, 2]);
    }

    #[test]
    fn saved_message_is_read_back_whole_or_refused() {
        let message = message();
        let bytes = message.to_bytes();
        let back = Received::<ClassTopic>::from_bytes(&bytes).expect("whole");
        assert_eq!((back.seq(), back.stamp(), back.header(), back.rows()), (3, -1, message.header(), message.rows()));
        for cut in 0..bytes.len() {
            let error = Received::<ClassTopic>::from_bytes(&bytes[..cut]).err();
            assert_eq!(error, Some(SavedMessageError::Cut { topic: "class", n_bytes: cut }));
        }
        let longer = [&bytes[..], b"xy"].concat();
        let error = Received::<ClassTopic>::from_bytes(&longer).err();
        assert_eq!(error, Some(SavedMessageError::Trailing { topic: "class", n_bytes: 2 }));
    }
}
