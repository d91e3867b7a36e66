//! The producing end of a channel.

use crate::channel::{MessageService, Transport};
use crate::copying::{Outlet, OwnLoan};
use crate::loan::{CacheLine, SharedLoan, WireEnvelope, lines_for};
use crate::memory::LoanMemory;
use crate::{Channel, Iox, IpcError, LatestSubscriber, Loan, Node, Waker};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{DegradationAction, publisher};
use iceoryx2::prelude::*;
use messages::{Envelope, Message};
use std::marker::PhantomData;

/// What a lossless observer acknowledges before its first message.
pub(crate) const NOTHING_TAKEN: u64 = u64::MAX;

/// Loans that a stage may hold at a time: one kept open over several steps, one for a message in between.
pub(crate) const MAX_LOANS: usize = 2;

/// Publishes messages of `T`, never more than its slowest consumer has room for.
pub struct Publisher<T: Message> {
    channel: Channel,
    port: Port,
    consumers: Vec<Consumer>,
    observer: LosslessObserver,
    sent: u64,
    /// Seq of the next message.
    next_seq: u64,
    message: PhantomData<T>,
}

enum Port {
    Shared { service: MessageService, publisher: publisher::Publisher<Iox, [CacheLine], WireEnvelope> },
    Copying(Outlet),
}

struct Consumer {
    /// Seq behind the last message that it took; `None` until it has taken one.
    taken: Option<u64>,
    acknowledgement: LatestSubscriber,
    /// `None` if the consumer rings itself, once it has copied a message.
    waker: Option<Waker>,
}

/// The place of somebody who looks on and must miss nothing.
struct LosslessObserver {
    /// Seq behind the last message that it took, or behind the last that it is not owed. `None` while it has said nothing.
    taken: Option<u64>,
    /// How often it has said the same since the last message was sent. It repeats itself when its queue is empty: what it
    /// says for the second time was said after that message had come.
    repeats: u32,
    acknowledgement: LatestSubscriber,
}

impl LosslessObserver {
    /// Messages up to `next_seq` that it has not taken. One that has died is forgotten once its node is cleaned up.
    fn n_waiting(&mut self, next_seq: u64) -> Result<u64, IpcError> {
        let there = self.acknowledgement.connect()?;
        // Also what one that has left said last: until it is taken the connection stays.
        let latest = self.acknowledgement.poll()?;
        if !there {
            (self.taken, self.repeats) = (None, 0);
            return Ok(0);
        }
        if let Some(bytes) = latest
            && let Ok(taken) = bytes.try_into()
        {
            let said = match u64::from_le_bytes(taken) {
                // One that has taken nothing yet is owed nothing of what went before it was known; but the last message,
                // sent since it was asked for, may lie in its queue. What it says later was perhaps said before more came.
                NOTHING_TAKEN => self.taken.unwrap_or(next_seq.saturating_sub(1)),
                taken => taken,
            };
            self.repeats = if self.taken == Some(said) { self.repeats + 1 } else { 0 };
            self.taken = Some(said);
        }
        // Nothing is on the way to it: what it lacks overran its queue before it was known, and will not come.
        if self.repeats >= 2 {
            return Ok(0);
        }
        // One that is there and not heard yet may count on everything from now on.
        Ok(self.taken.map_or(u64::MAX, |taken| next_seq.saturating_sub(taken)))
    }
}

impl Port {
    fn shared<T: Message>(node: &Node, channel: &Channel) -> Result<Self, IpcError> {
        let service = channel.open_as::<T>(node)?;
        let publisher = service
            .publisher_builder()
            .max_loaned_samples(MAX_LOANS)
            // All slots have the largest size. tmpfs gives memory to what is written, not to what is reserved; growing
            // slots instead lose one of their number with each growth and run out (iceoryx2 0.10).
            .initial_max_slice_len(lines_for::<T>(T::MAX_ROWS))
            .allocation_strategy(AllocationStrategy::Static)
            // Credits make sure that there is room; if there is none, that is a loss to be reported, not to wait for.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            // A connection that cannot be made is an error, not a warning in a log that nobody reads.
            .set_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .create()
            .map_err(|cause| IpcError::transport(format!("publisher of {}", channel.name), cause))?;
        Ok(Port::Shared { service, publisher })
    }
}

impl<T: Message> Publisher<T> {
    /// Opens the channel that the [`crate::Keeper`] made.
    pub fn open(node: &Node, channel: &Channel) -> Result<Self, IpcError> {
        let copying = channel.transport == Transport::Copying;
        let port =
            if copying { Port::Copying(Outlet::open::<T>(node, channel)?) } else { Port::shared::<T>(node, channel)? };
        let consumers = channel
            .consumers
            .iter()
            .enumerate()
            .map(|(index, wake)| {
                Ok(Consumer {
                    taken: None,
                    acknowledgement: LatestSubscriber::open(node, &channel.acknowledgement(index))?,
                    waker: if copying { None } else { Some(Waker::open(node, wake)?) },
                })
            })
            .collect::<Result<_, IpcError>>()?;
        let acknowledgement = LatestSubscriber::open(node, &channel.observer_acknowledgement())?;
        let observer = LosslessObserver { taken: None, repeats: 0, acknowledgement };
        let channel = channel.clone();
        Ok(Self { channel, port, consumers, observer, sent: 0, next_seq: 0, message: PhantomData })
    }

    /// Whether all consumers are there and connected. Messages sent before would be lost.
    pub fn connect(&self) -> Result<bool, IpcError> {
        let all_there = match &self.port {
            Port::Shared { service, publisher } => {
                // Observers are subscribers too; whether all consumers are there is for their acknowledgements to say.
                let all_there = service.dynamic_config().number_of_subscribers() >= self.consumers.len();
                publisher
                    .update_connections()
                    .map_err(|cause| IpcError::transport(format!("connecting {}", self.channel.name), cause))?;
                all_there
            }
            Port::Copying(outlet) => outlet.connect()?,
        };
        for consumer in &self.consumers {
            if !consumer.acknowledgement.connect()? {
                return Ok(false);
            }
        }
        Ok(all_there)
    }

    /// Memory for a message of at most `capacity` rows.
    pub fn loan(&self, capacity: usize) -> Result<Loan<T>, IpcError> {
        if capacity > T::MAX_ROWS {
            let what = format!("loan of {capacity} rows on {}", self.channel.name);
            return Err(IpcError::transport(what, format!("a message has at most {}", T::MAX_ROWS)));
        }
        Ok(Loan(match &self.port {
            Port::Shared { publisher, .. } => LoanMemory::Shared(SharedLoan::new(publisher, capacity)?),
            Port::Copying(_) => LoanMemory::Own(OwnLoan::new(capacity)),
        }))
    }

    /// Whether every consumer has room for one more message.
    pub fn has_credit(&mut self) -> Result<bool, IpcError> {
        let queue = self.channel.queue as u64;
        // Asked in any case: it is how the acknowledgements of consumers that have come anew are connected.
        let has_room = self.n_waiting()? < queue;
        Ok(self.channel.drops_oldest || has_room && self.observer.n_waiting(self.next_seq)? < queue)
    }

    /// Messages that the slowest consumer has not taken yet.
    pub fn n_waiting(&mut self) -> Result<u64, IpcError> {
        let mut waiting = 0;
        for consumer in &mut self.consumers {
            // Where nobody is waited for, a consumer may have left, its last word unheard.
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

    /// Sends. The caller has seen [`Publisher::has_credit`] since the last message.
    pub fn send(&mut self, loan: Loan<T>, envelope: Envelope) -> Result<(), IpcError> {
        let failed =
            |cause: String| IpcError::transport(format!("publishing {} {}", self.channel.name, envelope.seq), cause);
        let reached = match (loan.0, &self.port) {
            (LoanMemory::Shared(loan), Port::Shared { .. }) => {
                loan.finish(envelope).send().map_err(|cause| failed(format!("{cause:?}")))?
            }
            (LoanMemory::Own(loan), Port::Copying(outlet)) => outlet.send(&loan, envelope),
            _ => return Err(failed("a loan of another transport".to_owned())),
        };
        self.sent += 1;
        self.next_seq = envelope.seq + 1;
        self.observer.repeats = 0;
        let expected = self.consumers.len();
        // Observers may be among those whom it reached.
        if reached < expected && !self.channel.drops_oldest {
            let service = self.channel.name.clone();
            return Err(IpcError::Lost { service, seq: envelope.seq, reached, expected });
        }
        for waker in self.consumers.iter().filter_map(|consumer| consumer.waker.as_ref()) {
            waker.ring();
        }
        Ok(())
    }
}
