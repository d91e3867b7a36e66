//! The messages of one topic that wait for their submap; for `submap` itself, for their columns.

use crate::{Inputs, Received, StateBytes, StepError, next_message};
use messages::Message;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Messages in the order of submaps, one for each.
pub(super) struct Waiting<T: Message> {
    port: &'static str,
    is_expected: bool,
    /// The submap of the next message.
    next_seq: u64,
    held: VecDeque<Received<T>>,
}

/// One topic of a join without its messages, which follow in the saved state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedColumn {
    next_seq: u64,
    n_held: u64,
}

/// [`Waiting`] for any topic.
pub(crate) trait WaitingColumn {
    /// Takes the tick's messages and drops them if the topic is not expected. Live, numbers may be left out.
    fn take(&mut self, inputs: &mut Inputs, is_live: bool) -> Result<(), StepError>;
    /// Whether the message of submap `seq` has arrived or never will.
    fn is_settled(&self, seq: u64) -> bool;
    /// The topic, if the message of submap `seq` is expected and has not arrived.
    fn missing(&self, seq: u64) -> Option<&'static str>;
    /// Moves the message of submap `seq`, if it has arrived, to `columns`. Older ones, whose submap was lost, are dropped.
    fn move_seq(&mut self, seq: u64, columns: &mut Inputs);
    /// Live, the submaps of the oldest messages may never arrive: drops the messages that exceed a stage's limit.
    fn trim(&mut self);
    fn check_bound(&self) -> Result<(), StepError>;
    fn save(&self) -> SavedColumn;
    fn save_messages<'a>(&'a self, state: &mut StateBytes<'a>);
    /// Takes the topic's messages from the front of `messages`.
    fn load(&mut self, saved: &SavedColumn, messages: &mut &[u8]) -> Result<(), StepError>;
}

impl<T: Message> Waiting<T> {
    pub(super) fn new(port: &'static str, is_expected: bool) -> Self {
        Self { port, is_expected, next_seq: 0, held: VecDeque::new() }
    }
    pub(super) fn len(&self) -> usize {
        self.held.len()
    }
    pub(super) fn front_seq(&self) -> Option<u64> {
        self.held.front().map(Received::seq)
    }
    /// The message of submap `seq`. Older ones are dropped.
    pub(super) fn take_seq(&mut self, seq: u64) -> Option<Received<T>> {
        while self.front_seq().is_some_and(|front| front < seq) {
            self.held.pop_front();
        }
        if self.front_seq() == Some(seq) { self.held.pop_front() } else { None }
    }
}

impl<T: Message> WaitingColumn for Waiting<T> {
    fn take(&mut self, inputs: &mut Inputs, is_live: bool) -> Result<(), StepError> {
        for message in inputs.take_named::<T>(self.port) {
            let seq = message.seq();
            let due = self.next_seq;
            if seq < due || (seq > due && !is_live) {
                let text = format!("{} of submap {seq} arrived, but submap {due} was due", self.port);
                return Err(StepError::contract(text));
            }
            self.next_seq = seq + 1;
            if self.is_expected {
                self.held.push_back(message);
            }
        }
        Ok(())
    }

    fn is_settled(&self, seq: u64) -> bool {
        !self.is_expected || self.next_seq > seq
    }

    fn missing(&self, seq: u64) -> Option<&'static str> {
        let is_here = self.held.iter().any(|message| message.seq() == seq);
        (self.is_expected && !is_here).then_some(self.port)
    }

    fn move_seq(&mut self, seq: u64, columns: &mut Inputs) {
        if let Some(message) = self.take_seq(seq) {
            columns.push(self.port, message);
        }
    }

    fn trim(&mut self) {
        let n_held = self.held.len();
        drop(self.held.drain(..n_held.saturating_sub(T::BORROWED)));
    }

    fn check_bound(&self) -> Result<(), StepError> {
        let n_held = self.held.len();
        let limit = T::BORROWED;
        if n_held <= limit {
            return Ok(());
        }
        let seq = self.front_seq().unwrap_or_default();
        Err(StepError::contract(format!(
            "{} of submap {seq} still waits for its submap, but {n_held} messages wait, at most {limit} may",
            self.port
        )))
    }

    fn save(&self) -> SavedColumn {
        SavedColumn { next_seq: self.next_seq, n_held: self.held.len() as u64 }
    }

    fn save_messages<'a>(&'a self, state: &mut StateBytes<'a>) {
        self.held.iter().for_each(|message| state.push(message));
    }

    fn load(&mut self, saved: &SavedColumn, messages: &mut &[u8]) -> Result<(), StepError> {
        self.next_seq = saved.next_seq;
        self.held = (0..saved.n_held).map(|_| next_message(messages)).collect::<Result<_, _>>()?;
        Ok(())
    }
}
