//! All of a topic's producing end that does not depend on the type of its messages: numbers, waiting for room, and the tick
//! that follows the messages. Compiled once, here, and not again for each type in every program.

use super::context::PortContext;
use super::numbering::next_number;
use super::waiter::Waiter;
use crate::StepError;
use ipc::{IpcError, Publisher};
use messages::{Envelope, Message, TickRow, TickTopic};
use run::assignment::TopicChannels;
use run::health::{Activity, Pulse, Traffic};
use run::process::monotonic_nanos;
use std::rc::Rc;

/// Offline, consumers need not see each tick without messages at once. They see all of them before this stage sleeps.
const EMPTY_TICKS_PER_WAKE: u64 = 8;

/// How much room the consumers of a publisher have.
pub(super) trait Room {
    /// See [`Publisher::has_credit`].
    fn has_credit(&mut self) -> Result<bool, IpcError>;
    /// See [`Publisher::n_waiting`].
    fn n_waiting(&mut self) -> Result<u64, IpcError>;
}

impl<T: Message> Room for Publisher<T> {
    fn has_credit(&mut self) -> Result<bool, IpcError> {
        Publisher::has_credit(self)
    }
    fn n_waiting(&mut self) -> Result<u64, IpcError> {
        Publisher::n_waiting(self)
    }
}

/// A topic's producing end, without the publisher of its messages.
pub(super) struct UntypedOutput {
    topic: String,
    /// [`Message::TOPIC`].
    name: &'static str,
    /// [`Message::QUEUE`].
    queue: usize,
    ticks: Publisher<TickTopic>,
    context: PortContext,
    next_seq: u64,
    n_in_tick: usize,
    traffic: Traffic,
    /// The producer never waits for consumers; the newest message replaces the oldest.
    is_live: bool,
    /// Live: seq after the last message of the process that this one replaces.
    replaced: u64,
    /// Seq of the next tick. Live, ticks may be left out or repeated.
    next_tick_seq: u64,
    /// Seq of the last tick, which may be repeated.
    end_seq: Option<u64>,
}

impl UntypedOutput {
    pub(super) fn open(
        context: &PortContext,
        channels: &TopicChannels,
        name: &'static str,
        queue: usize,
    ) -> Result<Self, StepError> {
        Ok(Self {
            topic: channels.topic.clone(),
            name,
            queue,
            ticks: Publisher::open(&context.node, &channels.ticks)?,
            context: context.clone(),
            next_seq: 0,
            n_in_tick: 0,
            traffic: Traffic::default(),
            is_live: channels.messages.drops_oldest,
            replaced: 0,
            next_tick_seq: 0,
            end_seq: None,
        })
    }

    pub(super) fn waiter(&self) -> &Rc<Waiter> {
        &self.context.waiter
    }

    /// Waits for room for the next message, of `n_rows` with `n_bytes`, and counts it. Its envelope.
    pub(super) fn next(
        &mut self,
        messages: &mut dyn Room,
        n_rows: usize,
        n_bytes: usize,
        stamp: i64,
    ) -> Result<Envelope, StepError> {
        if self.n_in_tick == self.queue && !self.is_live {
            let text = format!("{}: more than {} messages in one tick", self.topic, self.queue);
            return Err(StepError::contract(text));
        }
        let waiter = &self.context.waiter;
        let room = waiter.wait_until(
            || Activity::Blocked(self.name.to_owned()),
            || {
                let credit = messages.has_credit()?;
                if !credit {
                    note_waiting(&waiter.pulse, &self.topic, messages)?;
                }
                Ok(credit)
            },
        )?;
        if !room {
            return Err(StepError::Stopped { topic: self.name });
        }
        waiter.pulse.set(Activity::Working);
        self.traffic.messages += 1;
        self.traffic.rows += n_rows as u64;
        self.traffic.bytes += n_bytes as u64;
        let clock = &self.context.clock;
        Ok(Envelope {
            seq: self.next_seq,
            stamp,
            tick: clock.tick.get(),
            born_nanos: clock.born_nanos.get(),
            sent_nanos: monotonic_nanos(),
            epoch: self.traffic.epoch,
            ..Envelope::default()
        })
    }

    /// What follows the sending of a message.
    pub(super) fn sent(&mut self, sent: Result<(), IpcError>) -> Result<(), StepError> {
        let waiter = &self.context.waiter;
        sent.map_err(|error| waiter.failed_send(self.name, error))?;
        waiter.pulse.mark_progress();
        self.next_seq += 1;
        self.traffic.next_seq = self.next_seq;
        self.n_in_tick += 1;
        Ok(())
    }

    pub(super) fn next_seq(&self) -> u64 {
        self.next_seq
    }

    pub(super) fn skip_to(&mut self, seq: u64) -> bool {
        if self.is_live {
            self.next_seq = seq;
        }
        seq >= self.replaced
    }

    pub(super) fn topic(&self) -> &str {
        &self.topic
    }

    /// Whether all consumers of the ticks are there.
    pub(super) fn connect(&self) -> Result<bool, StepError> {
        Ok(self.ticks.connect()?)
    }

    pub(super) fn publish_tick(&mut self, row: TickRow) -> Result<(), StepError> {
        let n_messages = std::mem::take(&mut self.n_in_tick);
        let (ticks, waiter) = (&mut self.ticks, &self.context.waiter);
        if !waiter.wait_until(|| Activity::Blocked(self.name.to_owned()), || Ok(ticks.has_credit()?))? {
            return Err(StepError::Stopped { topic: self.name });
        }
        let mut loan = self.ticks.loan(1)?;
        loan.extend_from_slice(&[TickRow { n_published: self.next_seq, ..row }])?;
        let seq = self.end_seq.unwrap_or(row.tick.max(self.next_tick_seq));
        self.next_tick_seq = seq + 1;
        self.end_seq = (row.end != 0).then_some(seq);
        let envelope = Envelope { seq, stamp: row.drive_time, tick: row.tick, ..Envelope::default() };
        self.ticks.send(loan, envelope).map_err(|error| waiter.failed_send(self.name, error))?;
        let is_of_interest = n_messages > 0 || row.barrier != 0 || row.end != 0;
        if self.is_live || is_of_interest || row.tick % EMPTY_TICKS_PER_WAKE == 0 {
            self.ticks.urge();
        }
        Ok(())
    }

    pub(super) fn is_drained(&mut self, messages: &mut dyn Room) -> Result<bool, StepError> {
        self.note_waiting(messages)?;
        // Live, messages may have been dropped; the last tick never is.
        Ok((self.is_live || messages.n_waiting()? == 0) && self.ticks.n_waiting()? == 0)
    }

    pub(super) fn resume(&mut self, published: Traffic) {
        self.next_seq = published.next_seq;
        if published.epoch > 0 {
            self.replaced = published.next_seq;
            self.next_seq = next_number(published.next_seq, published.epoch);
        }
        self.traffic = published;
    }

    pub(super) fn traffic(&self) -> Traffic {
        self.traffic.clone()
    }

    pub(super) fn note_waiting(&self, messages: &mut dyn Room) -> Result<(), StepError> {
        note_waiting(&self.context.waiter.pulse, &self.topic, messages)
    }
}

fn note_waiting(pulse: &Pulse, topic: &str, messages: &mut dyn Room) -> Result<(), StepError> {
    let waiting = messages.n_waiting()?;
    let mut health = pulse.update();
    match health.waiting.get_mut(topic) {
        Some(last) => *last = waiting,
        None => drop(health.waiting.insert(topic.to_owned(), waiting)),
    }
    Ok(())
}
