//! The consuming end of a channel.

use crate::channel::{MessageService, Transport};
use crate::copying::Inlet;
use crate::loan::{CacheLine, WireEnvelope, view};
use crate::memory::ReceivedMemory;
use crate::{Channel, Iox, IpcError, LatestPublisher, Node, Received, Waker};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{DegradationAction, ReceiveError, subscriber};
use iceoryx2::prelude::*;
use messages::Message;
use std::marker::PhantomData;

/// Receives messages of `T`, all of them, in order.
pub struct Subscriber<T: Message> {
    channel: Channel,
    port: Port<T>,
    acknowledgement: LatestPublisher,
    producer: Waker,
}

enum Port<T: Message> {
    Shared {
        service: MessageService,
        subscriber: subscriber::Subscriber<Iox, [CacheLine], WireEnvelope>,
        message: PhantomData<T>,
    },
    Copying(Inlet<T>),
}

impl<T: Message> Port<T> {
    fn shared(node: &Node, channel: &Channel) -> Result<Self, IpcError> {
        let service = channel.open_as::<T>(node)?;
        let subscriber = service
            .subscriber_builder()
            .buffer_size(channel.queue)
            // A connection that cannot be made is an error, not a warning in a log that nobody reads.
            .set_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .create()
            .map_err(|cause| IpcError::transport(format!("subscriber of {}", channel.name), cause))?;
        Ok(Port::Shared { service, subscriber, message: PhantomData })
    }
}

impl<T: Message> Subscriber<T> {
    /// Opens the channel that the [`crate::Keeper`] made, as its consumer `consumer` (the name of that one's wake).
    pub fn open(node: &Node, channel: &Channel, consumer: &str) -> Result<Self, IpcError> {
        let index = channel.consumers.iter().position(|name| name == consumer).ok_or_else(|| {
            IpcError::transport(format!("topic {}", channel.name), format!("{consumer} is not among its consumers"))
        })?;
        let port = match channel.transport {
            Transport::Shared => Port::shared(node, channel)?,
            Transport::Copying => Port::Copying(Inlet::new(node, channel, index)),
        };
        Ok(Self {
            port,
            acknowledgement: LatestPublisher::open(node, &channel.acknowledgement(index))?,
            producer: Waker::open(node, &channel.producer)?,
            channel: channel.clone(),
        })
    }

    /// Whether the producer is there and connected. What it sent before would be lost.
    pub fn connect(&self) -> Result<bool, IpcError> {
        let there = match &self.port {
            Port::Shared { service, subscriber, .. } => {
                let there = service.dynamic_config().number_of_publishers() > 0;
                subscriber
                    .update_connections()
                    .map_err(|cause| IpcError::transport(format!("connecting to {}", self.channel.name), cause))?;
                there
            }
            Port::Copying(inlet) => inlet.connect()?,
        };
        Ok(there && self.acknowledgement.has_reader())
    }

    /// The next message, if there is one. Its slot is free again when it is dropped.
    pub fn receive(&mut self) -> Result<Option<Received<T>>, IpcError> {
        let received = match &self.port {
            Port::Shared { subscriber, .. } => receive_shared(&self.channel, subscriber)?,
            Port::Copying(inlet) => inlet.receive()?.map(|message| Received(ReceivedMemory::Own(message))),
        };
        if let Some(received) = &received {
            let taken = received.envelope().seq + 1;
            self.acknowledgement.publish(&taken.to_le_bytes())?;
            self.producer.ring();
        }
        Ok(received)
    }
}

fn receive_shared<T: Message>(
    channel: &Channel,
    subscriber: &subscriber::Subscriber<Iox, [CacheLine], WireEnvelope>,
) -> Result<Option<Received<T>>, IpcError> {
    let sample = subscriber.receive().map_err(|cause| match cause {
        ReceiveError::ExceedsMaxBorrows => {
            IpcError::HeldTooMany { service: channel.name.clone(), allowed: channel.borrowed }
        }
        other @ ReceiveError::ConnectionFailure(_) => IpcError::transport(format!("receiving {}", channel.name), other),
    })?;
    let Some(sample) = sample else { return Ok(None) };
    let len = sample.user_header().0.len as usize;
    if view::<T>(sample.payload(), len).is_none() {
        let bytes = size_of_val(sample.payload());
        let service = channel.name.clone();
        return Err(IpcError::Torn { service, bytes, len, row_bytes: size_of::<T::Row>() });
    }
    Ok(Some(Received(ReceivedMemory::Shared(sample))))
}
