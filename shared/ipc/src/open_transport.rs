//! Which transport a channel has.

use crate::message_type::MessageType;
use crate::shared_memory::{SharedIncoming, SharedOutgoing};
use crate::socket::{SocketIncoming, SocketOutgoing};
use crate::transport::{Incoming, Outgoing};
use crate::{Channel, IpcError, Node, Transport};

/// The producing end of the channel's transport.
pub(crate) fn outgoing(node: &Node, channel: &Channel, message: MessageType) -> Result<Box<dyn Outgoing>, IpcError> {
    channel.check_type(&message)?;
    Ok(match channel.transport {
        Transport::Shared => Box::new(SharedOutgoing::open(node, channel, message)?),
        Transport::Copying => Box::new(SocketOutgoing::open(node, channel)?),
    })
}

/// The end of the channel's transport for its consumer `index`.
pub(crate) fn incoming(
    node: &Node,
    channel: &Channel,
    message: MessageType,
    index: usize,
) -> Result<Box<dyn Incoming>, IpcError> {
    channel.check_type(&message)?;
    Ok(match channel.transport {
        Transport::Shared => Box::new(SharedIncoming::open(node, channel, message)?),
        Transport::Copying => Box::new(SocketIncoming::new(node, channel, message, index)),
    })
}
