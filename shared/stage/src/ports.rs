//! The typed ends of a stage's topics in shared memory, and what the runner does with them without knowing the type.

use crate::access::{AnyOutput, Loan, Received};
use crate::assignment::TopicChannels;
use crate::health::{Activity, Arrivals, Latency, Pulse, Traffic};
use crate::histogram::Histogram;
use crate::process::{monotonic_nanos, thread_cpu_nanos};
use crate::{Inputs, StepError};
use ipc::{IpcError, Node, Publisher, Subscriber, Wake};
use messages::{Envelope, Message, Tick, TickRow};
use std::any::Any;
use std::cell::Cell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How long a sleeper trusts its wake before it looks by itself: bounds the reaction to a stop, and to a lost ring.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// The same while a run starts: nobody rings for having come, and a start should not take long.
const LOOK_AGAIN_AT_START: Duration = Duration::from_millis(10);

/// A consumer that is gone is the supervisor's to report, with that one's own last words; it has this long to end the run
/// before the loss itself is reported.
const LOSS_PATIENCE: Duration = Duration::from_secs(5);

/// Sleeping and stopping, shared by all ports of a stage.
pub(crate) struct Waiter {
    pub(crate) wake: Wake,
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) pulse: Arc<Pulse>,
    /// Time slept so far: a step that waits for room at a consumer is not at work.
    pub(crate) slept_nanos: Cell<u64>,
    /// CPU time so far for lending, sending, waiting and receiving.
    pub(crate) transport_nanos: Cell<u64>,
}

impl Waiter {
    /// Does `work` and puts its CPU time down to the transport. Not to be nested.
    pub(crate) fn transporting<R>(&self, work: impl FnOnce() -> R) -> R {
        let begun = thread_cpu_nanos();
        let result = work();
        self.transport_nanos.set(self.transport_nanos.get() + thread_cpu_nanos() - begun);
        result
    }

    /// Sleeps until `done`, with the heartbeat saying `activity` meanwhile. `false` if the run is being stopped.
    pub(crate) fn wait_until(
        &self,
        activity: impl Fn() -> Activity,
        mut done: impl FnMut() -> Result<bool, StepError>,
    ) -> Result<bool, StepError> {
        let mut said = None;
        while !done()? {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            let now = activity();
            let starting = matches!(now, Activity::Connecting(_) | Activity::Ready);
            if said.as_ref() != Some(&now) {
                self.pulse.set(now.clone());
                said = Some(now);
            }
            let begun = monotonic_nanos();
            self.wake.wait(if starting { LOOK_AGAIN_AT_START } else { LOOK_AGAIN })?;
            self.slept_nanos.set(self.slept_nanos.get() + monotonic_nanos() - begun);
        }
        Ok(true)
    }

    /// What a failed send comes to: an error at once, or, if a consumer is gone, after [`LOSS_PATIENCE`].
    fn failed_send(&self, topic: &'static str, error: IpcError) -> StepError {
        if !matches!(error, IpcError::Lost { .. }) {
            return error.into();
        }
        let deadline = monotonic_nanos() + LOSS_PATIENCE.as_nanos() as u64;
        let patience = || Ok(monotonic_nanos() > deadline);
        match self.wait_until(|| Activity::Blocked(topic.to_owned()), patience) {
            Ok(true) => error.into(),
            Ok(false) => StepError::Stopped { topic },
            Err(other) => other,
        }
    }
}

/// The tick that a stage is in.
#[derive(Default)]
pub(crate) struct Clock {
    pub(crate) tick: Cell<u64>,
    pub(crate) born_nanos: Cell<u64>,
}

/// A stage that is started anew in a live run numbers its messages and ticks on from a multiple of this: far more than can have
/// been published since the last heartbeat of the process before it.
const STRIDE: u64 = 1000;

/// The number with which the process `epoch` (1: the first to follow another) begins, so that it gives none that one before it may
/// have given. `heard` is behind the last that was heard of; one stride for each process, because any of them may have died before
/// its first was heard of.
pub(crate) fn beyond(heard: u64, epoch: u32) -> u64 {
    (heard / STRIDE + u64::from(epoch)) * STRIDE
}

/// What all ports of a stage share.
#[derive(Clone)]
pub(crate) struct PortContext {
    pub(crate) node: Rc<Node>,
    pub(crate) waiter: Rc<Waiter>,
    pub(crate) clock: Rc<Clock>,
}

pub(crate) type SharedInputMaker =
    fn(&PortContext, &TopicChannels, consumer: &str) -> Result<Box<dyn TickedInput>, StepError>;
pub(crate) type SharedOutputMaker = fn(&PortContext, &TopicChannels) -> Result<Box<dyn AnyOutput>, StepError>;

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

#[cfg(test)]
mod tests {
    use super::beyond;

    #[test]
    fn no_process_gives_a_number_that_one_before_it_gave() {
        // Whether a process was heard of after its messages, one bit for each.
        for heard_of in 0..1_u32 << 8 {
            let (mut heard, mut given) = (0, 0);
            for epoch in 1..=8 {
                let first = beyond(heard, epoch);
                assert!(first > given, "{first} after {given}, process {epoch} of {heard_of:08b}");
                given = first + 700;
                if heard_of >> (epoch - 1) & 1 == 1 {
                    heard = first + 300;
                }
            }
        }
    }
}
