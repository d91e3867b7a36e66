//! The producing end of a topic: messages, and the tick behind them.

use super::{PortContext, beyond};
use crate::StepError;
use crate::access::{AnyOutput, Loan};
use crate::assignment::TopicChannels;
use crate::health::{Activity, Pulse, Traffic};
use crate::process::monotonic_nanos;
use ipc::Publisher;
use messages::{Envelope, Message, Tick, TickRow};
use std::any::Any;
use std::rc::Rc;

/// An output as the runner sees it.
pub(crate) trait TickedOutput {
    fn topic(&self) -> &str;
    /// Whether all consumers are there.
    fn connect(&self) -> Result<bool, StepError>;
    /// Says that the tick is complete.
    fn publish_tick(&mut self, row: TickRow) -> Result<(), StepError>;
    /// Whether consumers have taken everything.
    fn is_drained(&mut self) -> Result<bool, StepError>;
    /// Goes on behind what was published before this process began.
    fn resume(&mut self, published: Traffic);
    fn traffic(&self) -> Traffic;
    /// Brings up to date what the heartbeat says of messages that wait for a consumer.
    fn note_waiting(&mut self) -> Result<(), StepError>;
}

/// A topic's producing end.
pub(crate) struct SharedOutput<T: Message> {
    topic: String,
    messages: Publisher<T>,
    ticks: Publisher<Tick>,
    context: PortContext,
    next_seq: u64,
    n_in_tick: usize,
    traffic: Traffic,
    /// Nobody is waited for; the oldest makes way.
    is_live: bool,
    /// Live: seq behind the last message of the process that this one follows.
    followed: u64,
    /// Seq of the next tick. Live, ticks may be left out or said again.
    next_tick_seq: u64,
    /// Seq of the last tick, which may be said again.
    end_seq: Option<u64>,
}

pub(crate) fn shared_output<T: Message>(
    context: &PortContext,
    channels: &TopicChannels,
) -> Result<Box<dyn AnyOutput>, StepError> {
    Ok(Box::new(SharedOutput::<T> {
        topic: channels.topic.clone(),
        messages: Publisher::open(&context.node, &channels.messages)?,
        ticks: Publisher::open(&context.node, &channels.ticks)?,
        context: context.clone(),
        next_seq: 0,
        n_in_tick: 0,
        traffic: Traffic::default(),
        is_live: channels.messages.drops_oldest,
        followed: 0,
        next_tick_seq: 0,
        end_seq: None,
    }))
}

impl<T: Message> SharedOutput<T> {
    pub(crate) fn loan(&self, capacity: usize) -> Result<ipc::Loan<T>, StepError> {
        Ok(self.context.waiter.transporting(|| self.messages.loan(capacity))?)
    }

    pub(crate) fn publish(&mut self, loan: Loan<T>, stamp: i64) -> Result<(), StepError> {
        let waiter = Rc::clone(&self.context.waiter);
        waiter.transporting(|| self.send(loan, stamp))
    }

    fn send(&mut self, loan: Loan<T>, stamp: i64) -> Result<(), StepError> {
        let Some(loan) = loan.into_shared() else {
            return Err(StepError::Contract(format!("{}: a loan that was not made by this run", self.topic)));
        };
        if self.n_in_tick == T::QUEUE && !self.is_live {
            let text = format!("{}: more than {} messages in one tick", self.topic, T::QUEUE);
            return Err(StepError::Contract(text));
        }
        let (messages, waiter) = (&mut self.messages, &self.context.waiter);
        let room = waiter.wait_until(
            || Activity::Blocked(T::TOPIC.to_owned()),
            || {
                let credit = messages.has_credit()?;
                if !credit {
                    note_waiting(&waiter.pulse, &self.topic, messages)?;
                }
                Ok(credit)
            },
        )?;
        if !room {
            return Err(StepError::Stopped { topic: T::TOPIC });
        }
        waiter.pulse.set(Activity::Working);
        self.traffic.messages += 1;
        self.traffic.rows += loan.rows().len() as u64;
        self.traffic.bytes += size_of_val(loan.rows()) as u64;
        let clock = &self.context.clock;
        let envelope = Envelope {
            seq: self.next_seq,
            stamp,
            tick: clock.tick.get(),
            born_nanos: clock.born_nanos.get(),
            sent_nanos: monotonic_nanos(),
            epoch: self.traffic.epoch,
            ..Envelope::default()
        };
        self.messages.send(loan, envelope).map_err(|error| waiter.failed_send(T::TOPIC, error))?;
        waiter.pulse.mark_progress();
        self.next_seq += 1;
        self.traffic.next_seq = self.next_seq;
        self.n_in_tick += 1;
        Ok(())
    }
}

impl<T: Message> AnyOutput for SharedOutput<T> {
    fn as_any(&mut self) -> &mut dyn Any {
        self
    }
    fn next_seq(&self) -> u64 {
        self.next_seq
    }
    fn skip_to(&mut self, seq: u64) -> bool {
        if self.is_live {
            self.next_seq = seq;
        }
        seq >= self.followed
    }
    fn ticked(&mut self) -> Option<&mut dyn TickedOutput> {
        Some(self)
    }
}

impl<T: Message> TickedOutput for SharedOutput<T> {
    fn topic(&self) -> &str {
        &self.topic
    }

    fn connect(&self) -> Result<bool, StepError> {
        Ok(self.messages.connect()? & self.ticks.connect()?)
    }

    fn publish_tick(&mut self, row: TickRow) -> Result<(), StepError> {
        self.n_in_tick = 0;
        let (ticks, waiter) = (&mut self.ticks, &self.context.waiter);
        if !waiter.wait_until(|| Activity::Blocked(T::TOPIC.to_owned()), || Ok(ticks.has_credit()?))? {
            return Err(StepError::Stopped { topic: T::TOPIC });
        }
        let mut loan = self.ticks.loan(1)?;
        if let Some(rows) = loan.grow(1) {
            rows[0] = TickRow { n_published: self.next_seq, ..row };
        }
        let seq = self.end_seq.unwrap_or(row.tick.max(self.next_tick_seq));
        self.next_tick_seq = seq + 1;
        self.end_seq = (row.end != 0).then_some(seq);
        let envelope = Envelope { seq, stamp: row.drive_time, tick: row.tick, ..Envelope::default() };
        self.ticks.send(loan, envelope).map_err(|error| waiter.failed_send(T::TOPIC, error))
    }

    fn is_drained(&mut self) -> Result<bool, StepError> {
        self.note_waiting()?;
        // Live, messages may have been dropped; the last tick never is.
        Ok((self.is_live || self.messages.n_waiting()? == 0) && self.ticks.n_waiting()? == 0)
    }

    fn resume(&mut self, published: Traffic) {
        self.next_seq = published.next_seq;
        if published.epoch > 0 {
            self.followed = published.next_seq;
            self.next_seq = beyond(published.next_seq, published.epoch);
        }
        self.traffic = published;
    }

    fn traffic(&self) -> Traffic {
        self.traffic.clone()
    }

    fn note_waiting(&mut self) -> Result<(), StepError> {
        note_waiting(&self.context.waiter.pulse, &self.topic, &mut self.messages)
    }
}

fn note_waiting<T: Message>(pulse: &Pulse, topic: &str, messages: &mut Publisher<T>) -> Result<(), StepError> {
    let waiting = messages.n_waiting()?;
    let mut health = pulse.update();
    match health.waiting.get_mut(topic) {
        Some(last) => *last = waiting,
        None => drop(health.waiting.insert(topic.to_owned(), waiting)),
    }
    Ok(())
}
