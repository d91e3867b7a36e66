//! The producing end of a channel.

use crate::channel::MessageService;
use crate::loan::{CacheLine, WireEnvelope, lines_for};
use crate::{Channel, Iox, IpcError, LatestSubscriber, Loan, Node, Waker};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{DegradationAction, publisher};
use iceoryx2::prelude::*;
use messages::{Envelope, Message};
use std::marker::PhantomData;

/// Loans that a stage may hold at a time: one kept open over several steps, one for a message in between.
const MAX_LOANS: usize = 2;

/// Publishes messages of `T`, never more than its slowest consumer has room for.
pub struct Publisher<T: Message> {
    channel: Channel,
    service: MessageService,
    publisher: publisher::Publisher<Iox, [CacheLine], WireEnvelope>,
    consumers: Vec<Consumer>,
    sent: u64,
    message: PhantomData<T>,
}

struct Consumer {
    taken: u64,
    acknowledgement: LatestSubscriber,
    waker: Waker,
}

impl<T: Message> Publisher<T> {
    /// Opens the channel that the [`crate::Keeper`] made.
    pub fn open(node: &Node, channel: &Channel) -> Result<Self, IpcError> {
        let service = channel.open(node)?;
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
        let consumers = channel
            .consumers
            .iter()
            .enumerate()
            .map(|(index, wake)| {
                Ok(Consumer {
                    taken: 0,
                    acknowledgement: LatestSubscriber::open(node, &channel.acknowledgement(index))?,
                    waker: Waker::open(node, wake)?,
                })
            })
            .collect::<Result<_, IpcError>>()?;
        Ok(Self { channel: channel.clone(), service, publisher, consumers, sent: 0, message: PhantomData })
    }

    /// Whether all consumers are there and connected. Messages sent before would be lost.
    pub fn connect(&self) -> Result<bool, IpcError> {
        let all_there = self.service.dynamic_config().number_of_subscribers() == self.consumers.len();
        self.publisher
            .update_connections()
            .map_err(|cause| IpcError::transport(format!("connecting {}", self.channel.name), cause))?;
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
        Loan::new(&self.publisher, capacity)
    }

    /// Whether every consumer has room for one more message.
    pub fn has_credit(&mut self) -> Result<bool, IpcError> {
        let queue = self.channel.queue as u64;
        Ok(self.n_waiting()? < queue)
    }

    /// Messages that the slowest consumer has not taken yet.
    pub fn n_waiting(&mut self) -> Result<u64, IpcError> {
        let mut waiting = 0;
        for consumer in &mut self.consumers {
            if let Some(bytes) = consumer.acknowledgement.poll()?
                && let Ok(taken) = bytes.try_into()
            {
                consumer.taken = u64::from_le_bytes(taken);
            }
            waiting = waiting.max(self.sent.saturating_sub(consumer.taken));
        }
        Ok(waiting)
    }

    /// Sends. The caller has seen [`Publisher::has_credit`] since the last message.
    pub fn send(&mut self, loan: Loan<T>, envelope: Envelope) -> Result<(), IpcError> {
        let reached = loan.finish(envelope).send().map_err(|cause| {
            IpcError::transport(format!("publishing {} {}", self.channel.name, envelope.seq), cause)
        })?;
        self.sent += 1;
        let expected = self.consumers.len();
        if reached != expected {
            let service = self.channel.name.clone();
            return Err(IpcError::Lost { service, seq: envelope.seq, reached, expected });
        }
        for consumer in &self.consumers {
            consumer.waker.ring();
        }
        Ok(())
    }
}
