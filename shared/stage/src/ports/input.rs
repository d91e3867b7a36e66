//! The consuming end of a topic: messages, gathered tick by tick or, live, as they have come.

use super::PortContext;
use crate::access::Received;
use crate::assignment::TopicChannels;
use crate::health::{Arrivals, Latency, Pulse, Traffic};
use crate::histogram::Histogram;
use crate::process::monotonic_nanos;
use crate::{Inputs, StepError};
use ipc::Subscriber;
use messages::{Envelope, Message, Tick, TickRow};
use std::collections::VecDeque;
use std::sync::Arc;

/// An input as the runner sees it.
pub(crate) trait TickedInput {
    fn topic(&self) -> &str;
    /// Whether its producer is there.
    fn connect(&self) -> Result<bool, StepError>;
    /// Takes what has arrived; `Some` when everything of `tick` is here.
    fn gather(&mut self, tick: u64) -> Result<Option<TickRow>, StepError>;
    /// Hands the gathered tick's messages over.
    fn deliver(&mut self, inputs: &mut Inputs);
    /// Live: takes what has arrived.
    fn gather_newest(&mut self) -> Result<Newest, StepError>;
    /// Live: hands over what was gathered.
    fn deliver_all(&mut self, inputs: &mut Inputs);
    /// Goes on behind what was delivered before this process began.
    fn resume(&mut self, delivered: Traffic);
    fn traffic(&self) -> Traffic;
    fn arrivals(&self) -> Arrivals;
}

/// What a live input has.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Newest {
    /// The last tick heard of, new or not.
    pub(crate) row: Option<TickRow>,
    /// The latest barrier among the ticks heard of now; later ticks may have followed it.
    pub(crate) barrier: u64,
    /// Whether messages wait to be handed over.
    pub(crate) has_messages: bool,
}

struct SharedInput<T: Message> {
    topic: String,
    messages: Subscriber<T>,
    ticks: Subscriber<Tick>,
    /// Messages that wait for their tick to be complete.
    pending: VecDeque<ipc::Received<T>>,
    row: Option<TickRow>,
    n_received: u64,
    traffic: Traffic,
    /// From publication to delivery.
    latency: Histogram,
    pulse: Arc<Pulse>,
}

impl<T: Message> SharedInput<T> {
    fn hand_over(&mut self, message: ipc::Received<T>, now: u64, inputs: &mut Inputs) {
        self.latency.add(now.saturating_sub(message.envelope().sent_nanos));
        self.traffic.messages += 1;
        self.traffic.rows += message.rows().len() as u64;
        self.traffic.bytes += size_of_val(message.rows()) as u64;
        self.traffic.next_seq = message.envelope().seq + 1;
        inputs.push(Received::shared(message));
    }

    /// Live: what is missing between two messages was dropped, unless the producer was started anew between them.
    fn count_dropped(&mut self, envelope: Envelope) {
        if envelope.epoch == self.traffic.epoch {
            self.traffic.dropped += envelope.seq.saturating_sub(self.n_received);
        }
        self.traffic.epoch = envelope.epoch;
        self.n_received = envelope.seq + 1;
    }
}

pub(crate) fn shared_input<T: Message>(
    context: &PortContext,
    channels: &TopicChannels,
    consumer: &str,
) -> Result<Box<dyn TickedInput>, StepError> {
    Ok(Box::new(SharedInput::<T> {
        topic: channels.topic.clone(),
        messages: Subscriber::open(&context.node, &channels.messages, consumer)?,
        ticks: Subscriber::open(&context.node, &channels.ticks, consumer)?,
        pending: VecDeque::new(),
        row: None,
        n_received: 0,
        traffic: Traffic::default(),
        latency: Histogram::default(),
        pulse: Arc::clone(&context.waiter.pulse),
    }))
}

impl<T: Message> TickedInput for SharedInput<T> {
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
        // No more than a queue's length waits here; a tick has no more than that (`SharedOutput::publish` sees to it).
        while self.pending.len() < T::QUEUE {
            let Some(message) = self.messages.receive()? else { break };
            let seq = message.envelope().seq;
            if seq != self.n_received {
                let text = format!("{}: message {seq} came when {} was due", self.topic, self.n_received);
                return Err(StepError::Contract(text));
            }
            self.n_received += 1;
            self.pending.push_back(message);
            // A tick may be long in coming; who looks on sees meanwhile what waits for it.
            self.pulse.update().arrivals.entry(self.topic.clone()).or_default().queue = self.pending.len() as u64;
        }
        let Some(row) = self.row else { return Ok(None) };
        if row.tick != tick {
            return Err(StepError::Contract(format!("{}: tick {} came when {tick} was due", self.topic, row.tick)));
        }
        Ok((self.n_received >= row.n_published).then_some(row))
    }

    fn deliver(&mut self, inputs: &mut Inputs) {
        let Some(row) = self.row.take() else { return };
        let now = monotonic_nanos();
        while self.pending.front().is_some_and(|message| message.envelope().tick <= row.tick) {
            let Some(message) = self.pending.pop_front() else { break };
            self.hand_over(message, now, inputs);
        }
    }

    fn gather_newest(&mut self) -> Result<Newest, StepError> {
        let mut newest = Newest::default();
        // Ticks first: what they speak of has been sent before them.
        while let Some(message) = self.ticks.receive()? {
            self.row = message.rows().first().copied().or(self.row);
            newest.barrier = newest.barrier.max(self.row.map_or(0, |row| row.barrier));
        }
        while self.pending.len() < T::QUEUE {
            let Some(message) = self.messages.receive()? else { break };
            self.count_dropped(*message.envelope());
            self.pending.push_back(message);
        }
        Ok(Newest { row: self.row, has_messages: !self.pending.is_empty(), ..newest })
    }

    fn deliver_all(&mut self, inputs: &mut Inputs) {
        let now = monotonic_nanos();
        while let Some(message) = self.pending.pop_front() {
            self.hand_over(message, now, inputs);
        }
    }

    fn resume(&mut self, delivered: Traffic) {
        self.n_received = delivered.next_seq;
        self.traffic = delivered;
    }

    fn traffic(&self) -> Traffic {
        self.traffic.clone()
    }

    fn arrivals(&self) -> Arrivals {
        Arrivals { queue: self.pending.len() as u64, latency: Latency::from(&self.latency) }
    }
}
