//! The consuming end of a channel.

use crate::channel::MessageService;
use crate::loan::{CacheLine, WireEnvelope, view};
use crate::{Channel, Iox, IpcError, LatestPublisher, Node, Waker};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{DegradationAction, ReceiveError, subscriber};
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use messages::{Envelope, Message};
use std::marker::PhantomData;

/// Receives messages of `T`, all of them, in order.
pub struct Subscriber<T: Message> {
    channel: Channel,
    service: MessageService,
    subscriber: subscriber::Subscriber<Iox, [CacheLine], WireEnvelope>,
    acknowledgement: LatestPublisher,
    producer: Waker,
    taken: u64,
    message: PhantomData<T>,
}

impl<T: Message> Subscriber<T> {
    /// Opens the channel that the [`crate::Keeper`] made, as its consumer `consumer` (the name of that one's wake).
    pub fn open(node: &Node, channel: &Channel, consumer: &str) -> Result<Self, IpcError> {
        let index = channel.consumers.iter().position(|name| name == consumer).ok_or_else(|| {
            IpcError::transport(format!("topic {}", channel.name), format!("{consumer} is not among its consumers"))
        })?;
        let service = channel.open(node)?;
        let subscriber = service
            .subscriber_builder()
            .buffer_size(channel.queue)
            // A connection that cannot be made is an error, not a warning in a log that nobody reads.
            .set_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .create()
            .map_err(|cause| IpcError::transport(format!("subscriber of {}", channel.name), cause))?;
        Ok(Self {
            service,
            subscriber,
            acknowledgement: LatestPublisher::open(node, &channel.acknowledgement(index))?,
            producer: Waker::open(node, &channel.producer)?,
            channel: channel.clone(),
            taken: 0,
            message: PhantomData,
        })
    }

    /// Whether the producer is there and connected. What it sent before would be lost.
    pub fn connect(&self) -> Result<bool, IpcError> {
        let there = self.service.dynamic_config().number_of_publishers() > 0 && self.acknowledgement.has_reader();
        self.subscriber
            .update_connections()
            .map_err(|cause| IpcError::transport(format!("connecting to {}", self.channel.name), cause))?;
        Ok(there)
    }

    /// The next message, if there is one. Its slot is free again when it is dropped.
    pub fn receive(&mut self) -> Result<Option<Received<T>>, IpcError> {
        let sample = self.subscriber.receive().map_err(|cause| match cause {
            ReceiveError::ExceedsMaxBorrows => {
                IpcError::HeldTooMany { service: self.channel.name.clone(), allowed: self.channel.borrowed }
            }
            other @ ReceiveError::ConnectionFailure(_) => {
                IpcError::transport(format!("receiving {}", self.channel.name), other)
            }
        })?;
        let Some(sample) = sample else { return Ok(None) };
        self.taken += 1;
        self.acknowledgement.publish(&self.taken.to_le_bytes())?;
        self.producer.ring();
        let len = sample.user_header().0.len as usize;
        if view::<T>(sample.payload(), len).is_none() {
            let bytes = size_of_val(sample.payload());
            let service = self.channel.name.clone();
            return Err(IpcError::Torn { service, bytes, len, row_bytes: size_of::<T::Row>() });
        }
        Ok(Some(Received { sample, message: PhantomData }))
    }
}

/// A message in shared memory. It stays readable after its producer's death.
pub struct Received<T: Message> {
    sample: Sample<Iox, [CacheLine], WireEnvelope>,
    message: PhantomData<T>,
}

impl<T: Message> Received<T> {
    /// The envelope.
    pub fn envelope(&self) -> &Envelope {
        &self.sample.user_header().0
    }
    fn view(&self) -> (&T::Header, &[T::Row]) {
        let len = self.envelope().len as usize;
        view::<T>(self.sample.payload(), len).expect("`Subscriber::receive` passes on only what fits")
    }
    /// The fixed part.
    pub fn header(&self) -> &T::Header {
        self.view().0
    }
    /// The rows, in place.
    pub fn rows(&self) -> &[T::Row] {
        self.view().1
    }
}
