//! The consuming end of a channel, without its type: compiled once here, and not for each message type in every
//! program.

use crate::message_type::MessageType;
use crate::node::SharedWaker;
use crate::shared_memory::SharedIncoming;
use crate::slot::ReceivedSlot;
use crate::{Channel, IpcError, LatestPublisher, Node};
use std::rc::Rc;

/// Receives messages and acknowledges them.
pub(crate) struct UntypedSubscriber {
    memory: SharedIncoming,
    acknowledgement: LatestPublisher,
    producer: Rc<SharedWaker>,
    /// Messages that it takes before the producer is urged to fill their places.
    batch: usize,
    /// Messages taken since the producer was last urged.
    n_taken: usize,
}

impl UntypedSubscriber {
    pub(crate) fn open(node: &Node, channel: &Channel, message: MessageType, consumer: &str) -> Result<Self, IpcError> {
        let index = channel.consumers.iter().position(|name| name == consumer).ok_or_else(|| {
            IpcError::transport(format!("topic {}", channel.name), format!("{consumer} is not among its consumers"))
        })?;
        Ok(Self {
            memory: SharedIncoming::open(node, channel, message)?,
            acknowledgement: LatestPublisher::open(node, &channel.acknowledgement(index))?,
            producer: node.shared_waker(&channel.producer)?,
            // A producer that waits for room can then produce several messages per wake.
            batch: if channel.drops_oldest { 1 } else { (channel.queue / 2).max(1) },
            n_taken: 0,
        })
    }

    pub(crate) fn connect(&self) -> Result<bool, IpcError> {
        Ok(self.memory.connect()? && self.acknowledgement.has_reader())
    }

    pub(crate) fn receive(&mut self) -> Result<Option<ReceivedSlot>, IpcError> {
        let received = self.memory.receive()?;
        if let Some(received) = &received {
            let taken = received.envelope().seq + 1;
            self.acknowledgement.publish(&taken.to_le_bytes())?;
            self.n_taken += 1;
            if self.n_taken >= self.batch {
                self.n_taken = 0;
                self.producer.urge();
            } else {
                self.producer.request();
            }
        }
        Ok(received)
    }
}
