//! Messages that wait for their tick to be complete: the part of an input that depends on its type.

use crate::{Inputs, StepError};
use ipc::{Channel, Node, Received, Subscriber};
use messages::{Envelope, Message};
use std::collections::VecDeque;

/// The messages of an input, received and not yet delivered.
pub(super) trait PendingMessages {
    /// Whether the producer is connected.
    fn connect(&self) -> Result<bool, StepError>;
    /// Receives and keeps the next message that has arrived.
    fn receive(&mut self) -> Result<Option<Envelope>, StepError>;
    fn len(&self) -> usize;
    fn first(&self) -> Option<Envelope>;
    /// Moves the first message, if there is one, to `inputs`.
    fn deliver_first(&mut self, inputs: &mut Inputs) -> MessageSize;
}

/// Size of a message's rows.
#[derive(Default)]
pub(super) struct MessageSize {
    pub(super) rows: u64,
    pub(super) bytes: u64,
}

struct Pending<T: Message> {
    /// The stage's name of the topic.
    port: &'static str,
    subscriber: Subscriber<T>,
    messages: VecDeque<Received<T>>,
}

pub(super) fn pending_messages<T: Message>(
    node: &Node,
    channel: &Channel,
    port: &'static str,
    consumer: &str,
) -> Result<Box<dyn PendingMessages>, StepError> {
    let subscriber = Subscriber::<T>::open(node, channel, consumer)?;
    Ok(Box::new(Pending { port, subscriber, messages: VecDeque::new() }))
}

impl<T: Message> PendingMessages for Pending<T> {
    fn connect(&self) -> Result<bool, StepError> {
        Ok(self.subscriber.connect()?)
    }

    fn receive(&mut self) -> Result<Option<Envelope>, StepError> {
        let Some(message) = self.subscriber.receive()? else { return Ok(None) };
        let envelope = *message.envelope();
        self.messages.push_back(message);
        Ok(Some(envelope))
    }

    fn len(&self) -> usize {
        self.messages.len()
    }

    fn first(&self) -> Option<Envelope> {
        self.messages.front().map(|message| *message.envelope())
    }

    fn deliver_first(&mut self, inputs: &mut Inputs) -> MessageSize {
        let Some(message) = self.messages.pop_front() else { return MessageSize::default() };
        let rows = message.rows();
        let size = MessageSize { rows: rows.len() as u64, bytes: size_of_val(rows) as u64 };
        inputs.push(self.port, message);
        size
    }
}
