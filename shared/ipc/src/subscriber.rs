//! The consuming end of a channel, by type.

use crate::message::ReceivedMemory;
use crate::message_type::MessageType;
use crate::untyped_subscriber::UntypedSubscriber;
use crate::{Channel, IpcError, Node, Received};
use messages::Message;
use std::marker::PhantomData;

/// Receives all messages of `T`, in order.
pub struct Subscriber<T: Message> {
    untyped: UntypedSubscriber,
    message: PhantomData<T>,
}

impl<T: Message> Subscriber<T> {
    /// Opens the channel that [`crate::ServiceHandles`] created, as its consumer `consumer` (the name of its wake).
    pub fn open(node: &Node, channel: &Channel, consumer: &str) -> Result<Self, IpcError> {
        let untyped = UntypedSubscriber::open(node, channel, MessageType::of::<T>(), consumer)?;
        Ok(Self { untyped, message: PhantomData })
    }

    /// Whether the producer is connected. Earlier messages would be lost.
    pub fn connect(&self) -> Result<bool, IpcError> {
        self.untyped.connect()
    }

    /// The next message, if there is one. Its slot is free again when it is dropped. The caller calls
    /// [`Node::wake_all`] before it sleeps: the producer may wait for room.
    pub fn receive(&mut self) -> Result<Option<Received<T>>, IpcError> {
        Ok(self.untyped.receive()?.map(|slot| Received(ReceivedMemory::Shared(slot))))
    }
}
