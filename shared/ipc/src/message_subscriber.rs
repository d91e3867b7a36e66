//! The receiving port of a channel, for a consumer or an observer.

use crate::channel::MessageService;
use crate::opaque::Opaque;
use crate::slot::{CacheLine, ReceivedSlot, WireEnvelope};
use crate::{Channel, Iox, IpcError, Node};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{DegradationAction, ReceiveError, subscriber};
use iceoryx2::prelude::*;

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
        self.port
            .update_connections()
            .map_err(|cause| IpcError::transport(format!("connecting to {}", channel.name), cause))?;
        Ok(is_there)
    }

    /// The next message, if there is one.
    pub(crate) fn receive(&self) -> Result<Option<ReceivedSlot>, ReceiveError> {
        Ok(self.port.receive()?.map(ReceivedSlot::new))
    }
}
