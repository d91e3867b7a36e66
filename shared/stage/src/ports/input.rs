//! The consuming end of a topic: messages, gathered tick by tick or, live, as they arrive.

use super::context::PortContext;
use super::pending::{PendingMessages, pending_messages};
use crate::{Inputs, StepError};
use ipc::Subscriber;
use messages::{Envelope, Message, TickRow, TickTopic};
use run::assignment::TopicChannels;
use run::health::{Arrivals, Latency, Pulse, Traffic};
use run::histogram::Histogram;
use run::process::monotonic_nanos;
use std::sync::Arc;

/// An input from the runner's point of view.
pub(crate) trait TickedInput {
    fn topic(&self) -> &str;
    /// Whether its producer is connected.
    fn connect(&self) -> Result<bool, StepError>;
    /// Takes the messages that have arrived; `Some` when all messages of `tick` have arrived.
    fn gather(&mut self, tick: u64) -> Result<Option<TickRow>, StepError>;
    /// Hands the gathered tick's messages over.
    fn deliver(&mut self, inputs: &mut Inputs);
    /// Live: takes the messages that have arrived.
    fn gather_newest(&mut self) -> Result<Newest, StepError>;
    /// Live: hands over the gathered messages.
    fn deliver_all(&mut self, inputs: &mut Inputs);
    /// Continues after the messages that were delivered before this process started.
    fn resume(&mut self, delivered: Traffic);
    fn traffic(&self) -> Traffic;
    fn arrivals(&self) -> Arrivals;
}

/// State of a live input.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Newest {
    /// The last tick received, new or not.
    pub(crate) row: Option<TickRow>,
    /// The latest barrier among the ticks received now; later ticks may have followed it.
    pub(crate) barrier: u64,
    /// Whether messages wait to be handed over.
    pub(crate) has_messages: bool,
}

/// An input in shared memory. Only [`PendingMessages`] depends on the type of its messages, so this type is compiled
/// once, here, and not for each message type in every program.
struct SharedInput {
    topic: String,
    messages: Box<dyn PendingMessages>,
    ticks: Subscriber<TickTopic>,
    /// Length of the queue, [`Message::QUEUE`].
    queue: usize,
    row: Option<TickRow>,
    n_received: u64,
    traffic: Traffic,
    /// Time from publication to delivery.
    latency: Histogram,
    pulse: Arc<Pulse>,
}

pub(crate) fn shared_input<T: Message>(
    context: &PortContext,
    channels: &TopicChannels,
    port: &'static str,
    consumer: &str,
) -> Result<Box<dyn TickedInput>, StepError> {
    let messages = pending_messages::<T>(&context.node, &channels.messages, port, consumer)?;
    untyped_input(context, channels, consumer, messages, T::QUEUE)
}

fn untyped_input(
    context: &PortContext,
    channels: &TopicChannels,
    consumer: &str,
    messages: Box<dyn PendingMessages>,
    queue: usize,
) -> Result<Box<dyn TickedInput>, StepError> {
    Ok(Box::new(SharedInput {
        topic: channels.topic.clone(),
        messages,
        ticks: Subscriber::open(&context.node, &channels.ticks, consumer)?,
        queue,
        row: None,
        n_received: 0,
        traffic: Traffic::default(),
        latency: Histogram::default(),
        pulse: Arc::clone(&context.waiter.pulse),
    }))
}

impl SharedInput {
    /// Hands the first pending message over, if it is of tick `last_tick` or before. `false` if no message is pending.
    fn hand_over(&mut self, last_tick: u64, now: u64, inputs: &mut Inputs) -> bool {
        let Some(envelope) = self.messages.first().filter(|envelope| envelope.tick <= last_tick) else { return false };
        self.latency.add(now.saturating_sub(envelope.sent_nanos));
        self.traffic.messages += 1;
        self.traffic.next_seq = envelope.seq + 1;
        let size = self.messages.deliver_first(inputs);
        self.traffic.rows += size.rows;
        self.traffic.bytes += size.bytes;
        true
    }

    /// Live: counts the messages missing between two others as dropped, unless the producer was restarted between them.
    fn count_dropped(&mut self, envelope: Envelope) {
        if envelope.epoch == self.traffic.epoch {
            self.traffic.dropped += envelope.seq.saturating_sub(self.n_received);
        }
        self.traffic.epoch = envelope.epoch;
        self.n_received = envelope.seq + 1;
    }
}

impl TickedInput for SharedInput {
    fn topic(&self) -> &str {
        &self.topic
    }

    fn connect(&self) -> Result<bool, StepError> {
        Ok(self.messages.connect()? & self.ticks.connect()?)
    }

    fn gather(&mut self, tick: u64) -> Result<Option<TickRow>, StepError> {
        if self.row.is_none()
            && let Some(message) = self.ticks.receive()?
        {
            self.row = message.rows().first().copied();
        }
        // At most the length of a queue waits here; a tick has no more messages (`SharedOutput::publish` ensures it).
        // Without the tick, take the messages that have arrived: its producer may wait for room.
        let n_published = self.row.map_or(u64::MAX, |row| row.n_published);
        while self.messages.len() < self.queue && self.n_received < n_published {
            let Some(Envelope { seq, .. }) = self.messages.receive()? else { break };
            if seq != self.n_received {
                let text = format!("{}: message {seq} arrived when {} was due", self.topic, self.n_received);
                return Err(StepError::contract(text));
            }
            self.n_received += 1;
            // A tick may take long to complete; meanwhile observers can read how many messages wait for it.
            self.pulse.update().arrivals.entry(self.topic.clone()).or_default().queue = self.messages.len() as u64;
        }
        let Some(row) = self.row else { return Ok(None) };
        if row.tick != tick {
            return Err(StepError::contract(format!("{}: tick {} arrived when {tick} was due", self.topic, row.tick)));
        }
        Ok((self.n_received >= row.n_published).then_some(row))
    }

    fn deliver(&mut self, inputs: &mut Inputs) {
        let Some(row) = self.row.take() else { return };
        let now = monotonic_nanos();
        while self.hand_over(row.tick, now, inputs) {}
    }

    fn gather_newest(&mut self) -> Result<Newest, StepError> {
        let mut newest = Newest::default();
        // Receive the ticks first: their messages have been sent before them.
        while let Some(message) = self.ticks.receive()? {
            self.row = message.rows().first().copied().or(self.row);
            newest.barrier = newest.barrier.max(self.row.map_or(0, |row| row.barrier));
        }
        while self.messages.len() < self.queue {
            let Some(envelope) = self.messages.receive()? else { break };
            self.count_dropped(envelope);
        }
        Ok(Newest { row: self.row, has_messages: self.messages.first().is_some(), ..newest })
    }

    fn deliver_all(&mut self, inputs: &mut Inputs) {
        let now = monotonic_nanos();
        while self.hand_over(u64::MAX, now, inputs) {}
    }

    fn resume(&mut self, delivered: Traffic) {
        self.n_received = delivered.next_seq;
        self.traffic = delivered;
    }

    fn traffic(&self) -> Traffic {
        self.traffic.clone()
    }

    fn arrivals(&self) -> Arrivals {
        Arrivals { queue: self.messages.len() as u64, latency: Latency::from(&self.latency) }
    }
}
