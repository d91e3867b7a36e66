//! The part of a topic's producing end that does not depend on the type of its messages: numbers, waiting for room, and
//! the tick that follows the messages. Compiled once, here, and not for each type in every program.

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

/// Offline, consumers are woken after this many ticks, or when this fraction of a queue's messages waits: at once for a
/// sweep or a submap, not for each pose of a whole drive. Before this stage sleeps, they are woken in any case.
const TICKS_PER_WAKE: u64 = 8;

/// Longest wait until half of a queue is free. Consumers take half of any queue in less time, unless they wait
/// themselves.
const MAX_REFILL_WAIT_NANOS: u64 = 50_000_000;

/// The room at the consumers of a publisher.
pub(super) trait Room {
    /// See [`Publisher::has_room`].
    fn has_room(&mut self, n: u64) -> Result<bool, IpcError>;
    /// See [`Publisher::n_waiting`].
    fn n_waiting(&mut self) -> Result<u64, IpcError>;
}

impl<T: Message> Room for Publisher<T> {
    fn has_room(&mut self, n: u64) -> Result<bool, IpcError> {
        Publisher::has_room(self, n)
    }
    fn n_waiting(&mut self) -> Result<u64, IpcError> {
        Publisher::n_waiting(self)
    }
}

/// A topic's producing end, without the publisher of its messages.
pub(super) struct UntypedOutput {
    topic: String,
    /// Length of the queue, [`Message::QUEUE`].
    queue: usize,
    ticks: Publisher<TickTopic>,
    context: PortContext,
    next_seq: u64,
    n_in_tick: usize,
    /// Messages since the consumers were woken.
    n_unannounced: usize,
    traffic: Traffic,
    /// The producer never waits for consumers; the newest message replaces the oldest.
    is_live: bool,
    /// Live: the sequence number after the last message of the process that this one replaces.
    replaced: u64,
    /// Sequence number of the next tick. Live, ticks may be left out or repeated.
    next_tick_seq: u64,
    /// Sequence number of the last tick, which may be repeated.
    end_seq: Option<u64>,
}

impl UntypedOutput {
    pub(super) fn open(context: &PortContext, channels: &TopicChannels, queue: usize) -> Result<Self, StepError> {
        Ok(Self {
            topic: channels.topic.clone(),
            queue,
            ticks: Publisher::open(&context.node, &channels.ticks)?,
            context: context.clone(),
            next_seq: 0,
            n_in_tick: 0,
            n_unannounced: 0,
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

    /// Waits for room for the next message, of `n_rows` with `n_bytes`, and counts it. Returns its envelope.
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
        wait_for_room(waiter, &self.topic, self.queue, messages, |messages| {
            note_waiting(&waiter.pulse, &self.topic, messages)
        })?;
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

    /// Completes the sending of a message.
    pub(super) fn sent(&mut self, sent: Result<(), IpcError>) -> Result<(), StepError> {
        let waiter = &self.context.waiter;
        sent.map_err(|error| waiter.failed_send(&self.topic, error))?;
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

    /// Whether all consumers of the ticks are connected.
    pub(super) fn connect(&self) -> Result<bool, StepError> {
        Ok(self.ticks.connect()?)
    }

    pub(super) fn publish_tick(&mut self, row: TickRow) -> Result<(), StepError> {
        self.n_unannounced += std::mem::take(&mut self.n_in_tick);
        let waiter = &self.context.waiter;
        wait_for_room(waiter, &self.topic, TickTopic::QUEUE, &mut self.ticks, |_| Ok(()))?;
        let mut loan = self.ticks.loan(1)?;
        loan.extend_from_slice(&[TickRow { n_published: self.next_seq, ..row }])?;
        let seq = self.end_seq.unwrap_or(row.tick.max(self.next_tick_seq));
        self.next_tick_seq = seq + 1;
        self.end_seq = (row.end != 0).then_some(seq);
        let envelope = Envelope { seq, stamp: row.drive_time, tick: row.tick, ..Envelope::default() };
        self.ticks.send(loan, envelope).map_err(|error| waiter.failed_send(&self.topic, error))?;
        let is_due = row.barrier != 0 || row.end != 0 || row.tick.is_multiple_of(TICKS_PER_WAKE);
        if self.is_live || is_due || self.n_unannounced >= self.queue.div_ceil(TICKS_PER_WAKE as usize) {
            self.n_unannounced = 0;
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

/// Waits for room for one message. A queue that was full is filled again only when half of it is free, so that producer and
/// consumer do not wake each other for every message, unless that takes long: a consumer may need just one more.
fn wait_for_room(
    waiter: &Waiter,
    topic: &str,
    queue: usize,
    messages: &mut dyn Room,
    blocked: impl Fn(&mut dyn Room) -> Result<(), StepError>,
) -> Result<(), StepError> {
    let mut full_since = None;
    let has_room = waiter.wait_until(
        || Activity::Blocked(topic.to_owned()),
        || {
            let wanted = match full_since {
                Some(since) if monotonic_nanos() - since < MAX_REFILL_WAIT_NANOS => (queue as u64).div_ceil(2),
                _ => 1,
            };
            let has_room = messages.has_room(wanted)?;
            if !has_room {
                full_since.get_or_insert_with(monotonic_nanos);
                blocked(messages)?;
            }
            Ok(has_room)
        },
    )?;
    if has_room { Ok(()) } else { Err(StepError::Stopped { topic: topic.to_owned() }) }
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
