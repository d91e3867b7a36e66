//! The channels of a recording.

use super::TICKS;
use messages::{ByteTable, Message, TickTopic};

/// A channel of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedTopic {
    /// Name of the channel: `submap`, `submap.tick`.
    pub name: String,
    /// Layout of its messages.
    pub table: ByteTable,
}

impl RecordedTopic {
    /// Topic to which the ticks belong, for a tick channel.
    pub fn ticks_of(&self) -> Option<&str> {
        self.name.strip_suffix(TICKS).filter(|_| self.table.topic == TickTopic::TOPIC)
    }
}
