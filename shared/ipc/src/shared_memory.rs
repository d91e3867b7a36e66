//! Messages in shared memory, by iceoryx2: written once, read in place.

use crate::channel::{MAX_LOANS, MessageService};
use crate::message_subscriber::MessageSubscriber;
use crate::message_type::MessageType;
use crate::opaque::Opaque;
use crate::slot::{CacheLine, FilledSlot, ReceivedSlot, Slot, WireEnvelope};
use crate::{Channel, Iox, IpcError, Node};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{DegradationAction, LoanError, ReceiveError, publisher};
use iceoryx2::prelude::*;
use messages::Envelope;

/// The producing end.
pub(crate) struct SharedOutgoing {
    channel: Channel,
    message: MessageType,
    service: Opaque<MessageService>,
    publisher: Opaque<publisher::Publisher<Iox, [CacheLine], WireEnvelope>>,
}

impl SharedOutgoing {
    pub(crate) fn open(node: &Node, channel: &Channel, message: MessageType) -> Result<Self, IpcError> {
        channel.check_type(&message)?;
        let service = channel.open(node)?;
        let publisher = service
            .publisher_builder()
            .max_loaned_samples(MAX_LOANS)
            // All slots have the largest size. tmpfs allocates memory only for written bytes; growing slots instead
            // lose one slot with each growth and run out (iceoryx2 0.10).
            .initial_max_slice_len(message.lines_for(message.max_rows))
            .allocation_strategy(AllocationStrategy::Static)
            // Credits guarantee free space in the queue. A full queue is therefore a loss: report it, do not wait.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            // A failed connection is an error, not a warning in a log that nobody reads.
            .set_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .create()
            .map(Opaque::new)
            .map_err(|cause| IpcError::transport(format!("publisher of {}", channel.name), cause))?;
        Ok(Self { channel: channel.clone(), message, service, publisher })
    }

    /// Connects to new consumers. Returns whether all are connected.
    pub(crate) fn connect(&self) -> Result<bool, IpcError> {
        // Observers are subscribers too; the acknowledgements show whether all consumers are connected.
        let all_there = self.service.dynamic_config().number_of_subscribers() >= self.channel.consumers.len();
        self.publisher
            .update_connections()
            .map_err(|cause| IpcError::transport(format!("connecting {}", self.channel.name), cause))?;
        Ok(all_there)
    }

    /// Shared memory for a message of at most `capacity` rows.
    pub(crate) fn slot(&self, capacity: usize) -> Result<Slot, IpcError> {
        let sample = self.publisher.loan_slice_uninit(self.message.lines_for(capacity)).map_err(|cause| {
            let what = format!("loan of {capacity} rows ({} bytes each)", self.message.row_bytes);
            match cause {
                LoanError::ExceedsMaxLoans => {
                    IpcError::transport(what, format_args!("a stage may hold {MAX_LOANS} loans of a topic at a time"))
                }
                other => IpcError::transport(what, other),
            }
        })?;
        Ok(Slot::new(sample))
    }

    /// Sends to all. Returns the number of consumers and observers that the message reached.
    pub(crate) fn send(&self, slot: FilledSlot, envelope: &Envelope) -> Result<usize, IpcError> {
        let sent = slot.into_sample().send();
        sent.map_err(|cause| IpcError::transport(format!("publishing {} {}", self.channel.name, envelope.seq), cause))
    }
}

/// The consuming end.
pub(crate) struct SharedIncoming {
    channel: Channel,
    message: MessageType,
    subscriber: MessageSubscriber,
}

impl SharedIncoming {
    pub(crate) fn open(node: &Node, channel: &Channel, message: MessageType) -> Result<Self, IpcError> {
        channel.check_type(&message)?;
        let subscriber = MessageSubscriber::open(node, channel, "subscriber")?;
        Ok(Self { channel: channel.clone(), message, subscriber })
    }

    /// Connects to the producer. Returns whether it is connected.
    pub(crate) fn connect(&self) -> Result<bool, IpcError> {
        self.subscriber.connect(&self.channel)
    }

    /// The next message, if there is one. It fits its slot.
    pub(crate) fn receive(&self) -> Result<Option<ReceivedSlot>, IpcError> {
        let channel = &self.channel;
        let slot = self.subscriber.receive().map_err(|cause| match cause {
            ReceiveError::ExceedsMaxBorrows => {
                IpcError::HeldTooMany { service: channel.name.clone(), allowed: channel.borrowed }
            }
            other @ ReceiveError::ConnectionFailure(_) => {
                IpcError::transport(format!("receiving {}", channel.name), other)
            }
        })?;
        let Some(slot) = slot else { return Ok(None) };
        let (envelope, lines) = slot.content();
        let len = envelope.len as usize;
        if !self.message.fits(lines.len(), len) {
            let service = channel.name.clone();
            return Err(IpcError::Torn { service, bytes: size_of_val(lines), len, row_bytes: self.message.row_bytes });
        }
        Ok(Some(slot))
    }
}
