//! The consuming end of a channel, without its type: compiled once here, not again for each type in every program.

use crate::message_type::MessageType;
use crate::open_transport::incoming;
use crate::transport::{Arrived, Incoming};
use crate::{Channel, IpcError, LatestPublisher, Node, Waker};

/// Receives messages and acknowledges them.
pub(crate) struct UntypedSubscriber {
    transport: Box<dyn Incoming>,
    acknowledgement: LatestPublisher,
    producer: Waker,
}

impl UntypedSubscriber {
    pub(crate) fn open(node: &Node, channel: &Channel, message: MessageType, consumer: &str) -> Result<Self, IpcError> {
        let index = channel.consumers.iter().position(|name| name == consumer).ok_or_else(|| {
            IpcError::transport(format!("topic {}", channel.name), format!("{consumer} is not among its consumers"))
        })?;
        Ok(Self {
            transport: incoming(node, channel, message, index)?,
            acknowledgement: LatestPublisher::open(node, &channel.acknowledgement(index))?,
            producer: Waker::open(node, &channel.producer)?,
        })
    }

    pub(crate) fn connect(&self) -> Result<bool, IpcError> {
        Ok(self.transport.connect()? && self.acknowledgement.has_reader())
    }

    pub(crate) fn receive(&mut self) -> Result<Option<Arrived>, IpcError> {
        let received = self.transport.receive()?;
        if let Some(received) = &received {
            let taken = received.envelope().seq + 1;
            self.acknowledgement.publish(&taken.to_le_bytes())?;
            self.producer.wake();
        }
        Ok(received)
    }
}
