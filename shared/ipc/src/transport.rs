//! How messages travel: what publisher and subscriber need of a transport.

use crate::IpcError;
use crate::own_memory::AnyOwnMessage;
use crate::slot::{FilledSlot, ReceivedSlot, Slot};
use messages::Envelope;

/// The producing end of a transport.
pub(crate) trait Outgoing {
    /// Connects to the consumers that have come; whether all are connected.
    fn connect(&self) -> Result<bool, IpcError>;
    /// Shared memory for a message of at most `capacity` rows; `None` if it is written in memory of this process.
    fn slot(&self, capacity: usize) -> Result<Option<Slot>, IpcError>;
    /// Sends to all; the number of consumers and observers that the message reached.
    fn send(&self, message: Written<'_>, envelope: &Envelope) -> Result<usize, IpcError>;
    /// Whether the publisher must notify the consumers of a message; otherwise their end of the transport does.
    fn needs_notification(&self) -> bool;
}

/// A message to send.
pub(crate) enum Written<'a> {
    /// In shared memory.
    Slot(FilledSlot),
    /// Envelope, header and rows, in memory of this process.
    Parts([&'a [u8]; 3]),
}

/// The consuming end of a transport.
pub(crate) trait Incoming {
    /// Connects to the producer; whether it is there.
    fn connect(&self) -> Result<bool, IpcError>;
    /// The next message, if there is one. It fits its memory.
    fn receive(&self) -> Result<Option<Arrived>, IpcError>;
}

/// A message that has arrived.
pub(crate) enum Arrived {
    /// In shared memory.
    Slot(ReceivedSlot),
    /// In memory of this process.
    Own(Box<dyn AnyOwnMessage>),
}

impl Arrived {
    pub(crate) fn envelope(&self) -> &Envelope {
        match self {
            Self::Slot(slot) => slot.envelope(),
            Self::Own(message) => message.envelope(),
        }
    }
}
