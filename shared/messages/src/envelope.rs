//! What every message carries, whatever its topic.

use crate::{Pod, pod};

pod! {
    /// The first 64 bytes of every message.
    ///
    /// | offset | field | meaning |
    /// |---|---|---|
    /// | 0 | `seq` | 0, 1, 2 … per topic, data messages only; a gap is a loss |
    /// | 8 | `stamp` | nanoseconds since the Unix epoch: when the content was measured |
    /// | 16 | `tick` | step of the source that this message belongs to |
    /// | 24 | `barrier` | on a tick: number of the barrier that it carries, 0 for none |
    /// | 32 | `born_nanos` | monotonic clock when the source began the tick |
    /// | 40 | `sent_nanos` | monotonic clock when this message was published |
    /// | 48 | `len` | rows in use; the slot may be longer |
    /// | 52 | `kind` | [`Kind`] |
    /// | 56 | `reserved` | zero |
    pub struct Envelope {
        /// 0, 1, 2 … per topic, data messages only.
        pub seq: u64,
        /// Nanoseconds since the Unix epoch.
        pub stamp: i64,
        /// Step of the source that this message belongs to.
        pub tick: u64,
        /// On a tick: number of the barrier that it carries, 0 for none.
        pub barrier: u64,
        /// Monotonic clock when the source began the tick. For latency figures only.
        pub born_nanos: u64,
        /// Monotonic clock when this message was published. For latency figures only.
        pub sent_nanos: u64,
        /// Rows in use.
        pub len: u32,
        /// See [`Kind`].
        pub kind: u32,
        /// Zero.
        pub reserved: u64,
    }
}

/// What a message is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Content.
    Data,
    /// Everything of this tick has been sent on this topic.
    Tick,
    /// As [`Kind::Tick`], and nothing follows.
    End,
}

impl Kind {
    /// As it stands in [`Envelope::kind`].
    pub const fn code(self) -> u32 {
        match self {
            Kind::Data => 0,
            Kind::Tick => 1,
            Kind::End => 2,
        }
    }
    /// `None` for a code that this version does not know.
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            0 => Some(Kind::Data),
            1 => Some(Kind::Tick),
            2 => Some(Kind::End),
            _ => None,
        }
    }
}

/// A topic's type: name, version, header, row and how much of it may be under way.
pub trait Message: Send + Sync + 'static {
    /// The topic's name.
    const TOPIC: &'static str;
    /// Raised with every change of meaning; a change of layout is seen by [`Pod::LAYOUT`] anyway.
    const VERSION: u32;
    /// Messages that may wait at each consumer. Bounds the memory and how far a producer may run ahead.
    const QUEUE: usize;
    /// Messages that a consumer may hold on to after its step.
    const BORROWED: usize;
    /// Fixed part.
    type Header: Pod + Default;
    /// Element of the slice.
    type Row: Pod;

    /// Fingerprint of envelope, header and row.
    const LAYOUT: u64 = pod::fingerprint(
        pod::fingerprint(Envelope::LAYOUT, &<Self::Header as Pod>::LAYOUT.to_le_bytes()),
        &<Self::Row as Pod>::LAYOUT.to_le_bytes(),
    );
}
