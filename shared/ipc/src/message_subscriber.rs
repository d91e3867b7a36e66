//! The receiving port of a channel, for a consumer or an observer.

use crate::channel::MessageService;
use crate::opaque::Opaque;
use crate::slot::{CacheLine, ReceivedSlot, WireEnvelope};
use crate::{Channel, Iox, IpcError, Node};
use iceoryx2::port::update_connections::{ConnectionFailure, UpdateConnections};
use iceoryx2::port::{DegradationAction, ReceiveError, subscriber};
use iceoryx2::prelude::*;
use iceoryx2_cal::shared_memory::SharedMemoryOpenError;

/// The service of a channel's messages, and the port that receives them.
pub(crate) struct MessageSubscriber {
    service: Opaque<MessageService>,
    port: Opaque<subscriber::Subscriber<Iox, [CacheLine], WireEnvelope>>,
}

impl MessageSubscriber {
    /// Opens the port. `role` is the name in errors.
    pub(crate) fn open(node: &Node, channel: &Channel, role: &str) -> Result<Self, IpcError> {
        let service = channel.open(node)?;
        let port = service
            .subscriber_builder()
            .buffer_size(channel.queue)
            // A failed connection is an error, not a warning in a log that nobody reads.
            .set_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .create()
            .map(Opaque::new)
            .map_err(|cause| IpcError::transport(format!("{role} of {}", channel.name), cause))?;
        Ok(Self { service, port })
    }

    /// Connects to the producer. Returns whether it was connected before, so that the connection is complete.
    pub(crate) fn connect(&self, channel: &Channel) -> Result<bool, IpcError> {
        let is_there = self.service.dynamic_config().number_of_publishers() > 0;
        match self.port.update_connections() {
            Ok(()) => Ok(is_there),
            Err(cause) if is_of_dead_producer(cause) => Ok(false),
            Err(cause) => Err(IpcError::transport(format!("connecting to {}", channel.name), cause)),
        }
    }

    /// The next message, if there is one.
    pub(crate) fn receive(&self) -> Result<Option<ReceivedSlot>, ReceiveError> {
        match self.port.receive() {
            Ok(sample) => Ok(sample.map(ReceivedSlot::new)),
            Err(ReceiveError::ConnectionFailure(cause)) if is_of_dead_producer(cause) => Ok(None),
            Err(cause) => Err(cause),
        }
    }
}

/// Whether the memory of a producer is gone that is still in the list: it was killed, and is being removed. Its successor changes the list
/// again, so that the next call connects to it.
fn is_of_dead_producer(cause: ConnectionFailure) -> bool {
    matches!(cause, ConnectionFailure::UnableToMapSendersDataSegment(SharedMemoryOpenError::DoesNotExist))
}
