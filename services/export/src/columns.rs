//! The messages of one topic that wait for their submap (or, of `submap` itself, for their columns).

use messages::Message;
use serde::{Deserialize, Serialize};
use stage::{Inputs, Received, StateBytes, StepError, next_message};
use std::collections::VecDeque;

/// Messages in the order of submaps, one for each.
pub(crate) struct Columns<T: Message> {
    is_expected: bool,
    /// The submap whose message is due.
    next_seq: u64,
    held: VecDeque<Received<T>>,
}

/// [`Columns`] without its messages, which follow in the saved state.
#[derive(Serialize, Deserialize)]
pub(crate) struct SavedColumns {
    next_seq: u64,
    n_held: u64,
}

impl<T: Message> Columns<T> {
    pub(crate) fn new(is_expected: bool) -> Self {
        Self { is_expected, next_seq: 0, held: VecDeque::new() }
    }
    pub(crate) fn len(&self) -> usize {
        self.held.len()
    }
    pub(crate) fn front_seq(&self) -> Option<u64> {
        self.held.front().map(Received::seq)
    }

    /// Takes the tick's messages; those that nobody asked for are let go. Live, numbers may be left out.
    pub(crate) fn take(&mut self, inputs: &mut Inputs, is_live: bool) -> Result<(), StepError> {
        for message in inputs.take::<T>() {
            let (seq, due) = (message.seq(), self.next_seq);
            if seq < due || (seq > due && !is_live) {
                return Err(StepError::Contract(format!(
                    "{} of submap {seq} arrived when that of {due} was due",
                    T::TOPIC
                )));
            }
            self.next_seq = seq + 1;
            if self.is_expected {
                self.held.push_back(message);
            }
        }
        Ok(())
    }

    /// Whether the message of submap `seq` is here, or will never be.
    pub(crate) fn is_settled(&self, seq: u64) -> bool {
        !self.is_expected || self.next_seq > seq
    }

    /// The topic, if the message of submap `seq` is expected and not here.
    pub(crate) fn missing(&self, seq: u64) -> Option<&'static str> {
        let is_here = self.held.iter().any(|message| message.seq() == seq);
        (self.is_expected && !is_here).then_some(T::TOPIC)
    }

    /// The message of submap `seq`. Older ones, whose submap was lost, go.
    pub(crate) fn take_seq(&mut self, seq: u64) -> Option<Received<T>> {
        while self.front_seq().is_some_and(|front| front < seq) {
            self.held.pop_front();
        }
        if self.front_seq() == Some(seq) { self.held.pop_front() } else { None }
    }

    /// Live, the submaps of the oldest may never come: no more are held than may be.
    pub(crate) fn trim(&mut self) {
        let n_held = self.held.len();
        drop(self.held.drain(..n_held.saturating_sub(T::BORROWED)));
    }

    pub(crate) fn check_bound(&self) -> Result<(), StepError> {
        if self.held.len() <= T::BORROWED {
            return Ok(());
        }
        let seq = self.front_seq().unwrap_or_default();
        Err(StepError::Contract(format!(
            "{} of submap {seq} still waits for the submap itself, but {} messages are held, {} may be",
            T::TOPIC,
            self.held.len(),
            T::BORROWED
        )))
    }

    pub(crate) fn save(&self) -> SavedColumns {
        SavedColumns { next_seq: self.next_seq, n_held: self.held.len() as u64 }
    }

    pub(crate) fn save_messages<'a>(&'a self, state: &mut StateBytes<'a>) {
        self.held.iter().for_each(|message| state.push(message));
    }

    /// Takes its messages off the front of `messages`.
    pub(crate) fn load(&mut self, saved: &SavedColumns, messages: &mut &[u8]) -> Result<(), StepError> {
        self.next_seq = saved.next_seq;
        self.held = (0..saved.n_held).map(|_| next_message(messages)).collect::<Result<_, _>>()?;
        Ok(())
    }
}
