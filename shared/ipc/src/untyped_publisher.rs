//! The producing end of a channel, without its type: compiled once here, and not for each message type in every
//! program.

use crate::message_type::MessageType;
use crate::node::SharedWaker;
use crate::shared_memory::SharedOutgoing;
use crate::slot::{FilledSlot, Slot};
use crate::{Channel, IpcError, LatestSubscriber, NOTHING_TAKEN, Node};
use messages::Envelope;
use std::rc::Rc;

/// Publishes messages and counts the credits of its consumers.
pub(crate) struct UntypedPublisher {
    channel: Channel,
    max_rows: usize,
    memory: SharedOutgoing,
    consumers: Vec<Consumer>,
    observer: LosslessObserver,
    sent: u64,
    /// Sequence number of the next message.
    next_seq: u64,
    /// Messages that may be sent without checking the acknowledgements again: free places at the last check.
    n_free: u64,
    /// `next_seq` at the last check.
    last_look: u64,
}

struct Consumer {
    /// Sequence number after the last message that it took; `None` until it has taken one.
    taken: Option<u64>,
    acknowledgement: LatestSubscriber,
    waker: Rc<SharedWaker>,
}

/// The lossless observer of the topic, if there is one.
struct LosslessObserver {
    /// Sequence number after the last message that it took or need not receive. `None` until its first acknowledgement.
    taken: Option<u64>,
    /// Number of repetitions of its acknowledgement since the last message was sent. It repeats when its queue is
    /// empty: the second repetition was sent after that message had arrived.
    repeats: u32,
    acknowledgement: LatestSubscriber,
}

impl LosslessObserver {
    fn is_there(&self) -> Result<bool, IpcError> {
        Ok(self.taken.is_some() || self.acknowledgement.connect()?)
    }

    /// Messages up to `next_seq` that it has not taken; `last_look`: `next_seq` at the last call. An observer that was killed is
    /// removed with its node.
    fn n_waiting(&mut self, next_seq: u64, last_look: u64) -> Result<u64, IpcError> {
        let there = self.acknowledgement.connect()?;
        // Polls for a last acknowledgement even after the observer has left: until then the connection stays.
        let latest = self.acknowledgement.poll()?;
        if !there {
            self.taken = None;
            self.repeats = 0;
            return Ok(0);
        }
        if let Some(bytes) = latest
            && let Ok(taken) = bytes.try_into()
        {
            let acknowledged = match u64::from_le_bytes(taken) {
                // A new observer need not receive messages from before its registration, but messages sent since the
                // last check may be in its queue. A later acknowledgement may have been sent before further messages.
                NOTHING_TAKEN => self.taken.unwrap_or(last_look),
                taken => taken,
            };
            self.repeats = if self.taken == Some(acknowledged) { self.repeats + 1 } else { 0 };
            self.taken = Some(acknowledged);
        }
        // Its queue is empty: the missing messages overran the queue before its registration, and will not arrive.
        if self.repeats >= 2 {
            return Ok(0);
        }
        // A connected observer without an acknowledgement receives every message from now on.
        Ok(self.taken.map_or(u64::MAX, |taken| next_seq.saturating_sub(taken)))
    }
}

impl UntypedPublisher {
    pub(crate) fn open(node: &Node, channel: &Channel, message: MessageType) -> Result<Self, IpcError> {
        let memory = SharedOutgoing::open(node, channel, message)?;
        let consumers = channel
            .consumers
            .iter()
            .enumerate()
            .map(|(index, wake)| {
                Ok(Consumer {
                    taken: None,
                    acknowledgement: LatestSubscriber::open(node, &channel.acknowledgement(index))?,
                    waker: node.shared_waker(wake)?,
                })
            })
            .collect::<Result<_, IpcError>>()?;
        let acknowledgement = LatestSubscriber::open(node, &channel.observer_acknowledgement())?;
        let observer = LosslessObserver { taken: None, repeats: 0, acknowledgement };
        let channel = channel.clone();
        Ok(Self {
            channel,
            max_rows: message.max_rows,
            memory,
            consumers,
            observer,
            sent: 0,
            next_seq: 0,
            n_free: 0,
            last_look: 0,
        })
    }

    pub(crate) fn connect(&self) -> Result<bool, IpcError> {
        let all_there = self.memory.connect()?;
        for consumer in &self.consumers {
            if !consumer.acknowledgement.connect()? {
                return Ok(false);
            }
        }
        Ok(all_there)
    }

    /// See [`SharedOutgoing::slot`].
    pub(crate) fn slot(&self, capacity: usize) -> Result<Slot, IpcError> {
        if capacity > self.max_rows {
            let what = format!("loan of {capacity} rows on {}", self.channel.name);
            return Err(IpcError::transport(what, format!("a message has at most {}", self.max_rows)));
        }
        self.memory.slot(capacity)
    }

    /// Whether every consumer has room for `n` more messages.
    pub(crate) fn has_room(&mut self, n: u64) -> Result<bool, IpcError> {
        if self.n_free >= n {
            return Ok(true);
        }
        let queue = self.channel.queue as u64;
        let n_waiting = self.n_waiting()?;
        let last_look = std::mem::replace(&mut self.last_look, self.next_seq);
        if self.channel.drops_oldest {
            // Polled in any case: this connects the acknowledgements of restarted consumers.
            return Ok(true);
        }
        if n_waiting + n > queue {
            return Ok(false);
        }
        if self.observer.is_there()? {
            return Ok(self.observer.n_waiting(self.next_seq, last_look)?.saturating_add(n) <= queue);
        }
        // A check costs as much as a message. Half of the places are used without one, so that a new observer is found
        // soon.
        self.n_free = (queue - n_waiting).min(queue.div_ceil(2));
        Ok(true)
    }

    /// Messages that the slowest consumer has not taken yet.
    pub(crate) fn n_waiting(&mut self) -> Result<u64, IpcError> {
        let mut waiting = 0;
        for consumer in &mut self.consumers {
            // Live, a consumer may have ended before its last acknowledgement was received.
            if self.channel.drops_oldest && !consumer.acknowledgement.connect()? {
                continue;
            }
            if let Some(bytes) = consumer.acknowledgement.poll()?
                && let Ok(taken) = bytes.try_into()
            {
                consumer.taken = Some(u64::from_le_bytes(taken));
            }
            let behind = consumer.taken.map_or(self.sent, |taken| self.next_seq.saturating_sub(taken));
            waiting = waiting.max(behind);
        }
        Ok(waiting)
    }

    /// See [`crate::Publisher::urge`].
    pub(crate) fn urge(&self) {
        for consumer in &self.consumers {
            consumer.waker.urge();
        }
    }

    pub(crate) fn send(&mut self, slot: FilledSlot, envelope: &Envelope) -> Result<(), IpcError> {
        let reached = self.memory.send(slot, envelope)?;
        self.sent += 1;
        self.n_free = self.n_free.saturating_sub(1);
        self.next_seq = envelope.seq + 1;
        self.observer.repeats = 0;
        let expected = self.consumers.len();
        // It may also have reached observers.
        if reached < expected && !self.channel.drops_oldest {
            let service = self.channel.name.clone();
            return Err(IpcError::Lost { service, seq: envelope.seq, reached, expected });
        }
        for consumer in &self.consumers {
            consumer.waker.request();
        }
        Ok(())
    }
}
