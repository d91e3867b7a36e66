//! Joins each submap with its columns, which may arrive in later ticks.
//!
//! ```
//! use stage::messages::{ClassTopic, ColorTopic};
//! use stage::{Inputs, Mode, StepError, SubmapJoin};
//!
//! fn step(join: &mut SubmapJoin, inputs: &mut Inputs) -> Result<(), StepError> {
//!     join.take(inputs)?;
//!     while let Some(joined) = join.next_complete() {
//!         let classes = joined.rows::<ClassTopic>()?.unwrap_or_default();
//!         println!("submap {}: {} points, {} classes", joined.submap.seq(), joined.submap.rows().len(), classes.len());
//!     }
//!     join.check_bounds()
//! }
//!
//! let mut join = SubmapJoin::new(Mode::Offline).column::<ClassTopic>(true).column::<ColorTopic>(false);
//! step(&mut join, &mut Inputs::default()).expect("nothing to join yet");
//! ```

mod waiting;

pub use waiting::SavedColumn;

use crate::untyped::UntypedMessage;
use crate::{Inputs, Mode, Port, Received, StateBytes, StepError};
use messages::{Message, SubmapTopic};
use waiting::{Waiting, WaitingColumn};

/// The type of [`waiting`] for one message type.
pub(crate) type WaitingMaker = fn(&'static str, bool) -> Box<dyn WaitingColumn>;

pub(crate) fn waiting<T: Message>(port: &'static str, is_expected: bool) -> Box<dyn WaitingColumn> {
    Box::new(Waiting::<T>::new(port, is_expected))
}

/// Submaps that wait for columns, and columns that wait for their submap.
pub struct SubmapJoin {
    is_live: bool,
    submaps: Waiting<SubmapTopic>,
    columns: Vec<Box<dyn WaitingColumn>>,
}

/// A submap with its columns.
pub struct JoinedSubmap {
    /// The submap.
    pub submap: Received<SubmapTopic>,
    columns: Inputs,
    /// Topics whose column of this submap is expected and has not arrived. Live, it was lost.
    pub lost: Vec<&'static str>,
}

impl JoinedSubmap {
    /// The column of `T`; `None` if the topic has no producer, is not joined or its column was lost.
    pub fn column<T: Message>(&self) -> Option<&Received<T>> {
        self.columns.first::<T>(T::TOPIC)
    }

    /// The rows of the column of `T`, one for each point. Another number of rows is an error.
    pub fn rows<T: Message>(&self) -> Result<Option<&[T::Row]>, StepError> {
        self.rows_named::<T>(T::TOPIC)
    }

    /// [`JoinedSubmap::rows`] for a [port with another name](crate::Port::named).
    pub fn rows_named<T: Message>(&self, port: &str) -> Result<Option<&[T::Row]>, StepError> {
        let Some(column) = self.columns.first::<T>(port) else { return Ok(None) };
        self.check_length(port, column.rows().len())?;
        Ok(Some(column.rows()))
    }

    /// [`JoinedSubmap::rows`] as bytes, for a port that is known at run time.
    pub fn row_bytes(&self, port: &Port) -> Result<Option<&[u8]>, StepError> {
        let Some(column) = self.untyped(port) else { return Ok(None) };
        self.check_length(port.topic(), column.envelope().len as usize)?;
        Ok(Some(column.rows()))
    }

    /// [`JoinedSubmap::column`] for a port that is known at run time.
    pub fn untyped(&self, port: &Port) -> Option<&dyn UntypedMessage> {
        (port.make.first)(&self.columns, port.topic())
    }

    fn check_length(&self, port: &str, n_rows: usize) -> Result<(), StepError> {
        let seq = self.submap.seq();
        let n_points = self.submap.rows().len();
        if n_rows == n_points {
            return Ok(());
        }
        Err(StepError::data(format!("{port} column of submap {seq} has {n_rows} rows for {n_points} points")))
    }
}

impl SubmapJoin {
    /// A join of submaps without columns.
    pub fn new(mode: Mode) -> Self {
        Self { is_live: mode == Mode::Live, submaps: Waiting::new(SubmapTopic::TOPIC, true), columns: Vec::new() }
    }

    /// Adds the column of `T`. `is_expected`: every submap waits for it; otherwise its messages are dropped.
    #[must_use]
    pub fn column<T: Message>(self, is_expected: bool) -> Self {
        self.column_named::<T>(T::TOPIC, is_expected)
    }

    /// [`SubmapJoin::column`] for a [port with another name](crate::Port::named).
    #[must_use]
    pub fn column_named<T: Message>(mut self, port: &'static str, is_expected: bool) -> Self {
        self.columns.push(waiting::<T>(port, is_expected));
        self
    }

    /// [`SubmapJoin::column`] for a port that is known at run time.
    #[must_use]
    pub fn column_of(mut self, port: &Port, is_expected: bool) -> Self {
        self.columns.push((port.make.waiting)(port.topic(), is_expected));
        self
    }

    /// Takes the tick's messages.
    pub fn take(&mut self, inputs: &mut Inputs) -> Result<(), StepError> {
        self.submaps.take(inputs, self.is_live)?;
        self.columns.iter_mut().try_for_each(|column| column.take(inputs, self.is_live))
    }

    /// The oldest submap, once all its columns have arrived or can no longer arrive. Live, a lost column may be the
    /// newest of its topic: then the submap is returned as soon as more submaps wait than a stage may hold.
    pub fn next_complete(&mut self) -> Option<JoinedSubmap> {
        let seq = self.submaps.front_seq()?;
        let is_settled = self.columns.iter().all(|column| column.is_settled(seq));
        let is_forced = self.is_live && self.submaps.len() > SubmapTopic::BORROWED;
        if is_settled || is_forced { self.take_oldest() } else { None }
    }

    /// The oldest submap with the columns that have arrived; for the end of the stream.
    pub fn take_oldest(&mut self) -> Option<JoinedSubmap> {
        let seq = self.submaps.front_seq()?;
        let lost = self.missing(seq);
        let submap = self.submaps.take_seq(seq)?;
        let mut columns = Inputs::default();
        self.columns.iter_mut().for_each(|column| column.move_seq(seq, &mut columns));
        Some(JoinedSubmap { submap, columns, lost })
    }

    /// Whether columns may be lost.
    pub fn is_live(&self) -> bool {
        self.is_live
    }

    /// Fails if more messages wait than a stage may hold: the stages before this one work in order and hold a bounded
    /// number of submaps, so offline all columns arrive in bounded time. Live, the oldest columns are dropped instead.
    pub fn check_bounds(&mut self) -> Result<(), StepError> {
        if self.is_live {
            self.columns.iter_mut().for_each(|column| column.trim());
            return Ok(());
        }
        let n_waiting = self.submaps.len();
        if n_waiting > SubmapTopic::BORROWED {
            return Err(self.incomplete(&format!("{n_waiting} submaps wait, at most {} may", SubmapTopic::BORROWED)));
        }
        self.columns.iter().try_for_each(|column| column.check_bound())
    }

    /// Fails if a submap is left at the end of the stream.
    pub fn check_empty(&self) -> Result<(), StepError> {
        if self.submaps.len() == 0 { Ok(()) } else { Err(self.incomplete("the stream has ended")) }
    }

    fn incomplete(&self, why: &str) -> StepError {
        let seq = self.submaps.front_seq().unwrap_or_default();
        StepError::contract(format!("submap {seq} still waits for {}, but {why}", self.missing(seq).join(" and ")))
    }

    /// Topics whose column of submap `seq` is expected and has not arrived.
    fn missing(&self, seq: u64) -> Vec<&'static str> {
        self.columns.iter().filter_map(|column| column.missing(seq)).collect()
    }

    /// The head of a saved state: first the submaps, then the columns in the order in which they were added. The
    /// messages follow the head: [`SubmapJoin::save_messages`].
    pub fn save(&self) -> Vec<SavedColumn> {
        let columns = self.columns.iter().map(|column| column.save());
        std::iter::once(WaitingColumn::save(&self.submaps)).chain(columns).collect()
    }

    /// Appends the messages that wait.
    pub fn save_messages<'a>(&'a self, state: &mut StateBytes<'a>) {
        self.submaps.save_messages(state);
        self.columns.iter().for_each(|column| column.save_messages(state));
    }

    /// The inverse of [`SubmapJoin::save`] and [`SubmapJoin::save_messages`].
    pub fn load(&mut self, saved: &[SavedColumn], mut messages: &[u8]) -> Result<(), StepError> {
        let n_saved = saved.len();
        let Some((submaps, columns)) = saved.split_first().filter(|(_, columns)| columns.len() == self.columns.len())
        else {
            let n_expected = self.columns.len() + 1;
            return Err(StepError::data(format!("saved state: {n_saved} topics of a join, expected {n_expected}")));
        };
        self.submaps.load(submaps, &mut messages)?;
        for (column, saved) in self.columns.iter_mut().zip(columns) {
            column.load(saved, &mut messages)?;
        }
        if messages.is_empty() {
            return Ok(());
        }
        Err(StepError::data(format!("saved state: {} bytes more than its head states", messages.len())))
    }
}

#[cfg(test)]
mod tests;
