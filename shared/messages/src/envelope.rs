//! The envelope of every message, and the definition of a topic.

use crate::{Pod, pod};

pod! {
    /// The first 64 bytes of every message.
    ///
    /// | offset | field | meaning |
    /// |---|---|---|
    /// | 0 | `seq` | 0, 1, 2 … per topic; a gap is a loss; on a column, the seq of its submap |
    /// | 8 | `stamp` | nanoseconds since the Unix epoch: when the content was measured |
    /// | 16 | `tick` | step of the source that this message belongs to |
    /// | 24 | `born_nanos` | monotonic clock when the source began the tick |
    /// | 32 | `sent_nanos` | monotonic clock when this message was published |
    /// | 40 | `len` | rows in use; the slot may be longer |
    /// | 44 | `epoch` | live: number of restarts of the producer; offline zero |
    /// | 48 | `reserved` | zero |
    pub struct Envelope {
        /// 0, 1, 2 … per topic.
        pub seq: u64,
        /// Nanoseconds since the Unix epoch.
        pub stamp: i64,
        /// Step of the source that this message belongs to.
        pub tick: u64,
        /// Monotonic clock when the source began the tick. For latency figures only.
        pub born_nanos: u64,
        /// Monotonic clock when this message was published. For latency figures only.
        pub sent_nanos: u64,
        /// Rows in use.
        pub len: u32,
        /// Live: number of restarts of the producer; its `seq` jumps at each. Offline zero.
        pub epoch: u32,
        /// Zero.
        pub reserved: [u32; 4],
    }
}

/// A topic's type: name, version, header, row and queue lengths.
pub trait Message: Send + Sync + 'static {
    /// The topic's name.
    const TOPIC: &'static str;
    /// Raised with every change of meaning. [`Pod::LAYOUT`] shows a change of layout.
    const VERSION: u32;
    /// Messages that may wait at each consumer. Bounds the memory and how far a producer may run ahead; a stage may not
    /// publish more than this in one tick.
    const QUEUE: usize;
    /// Messages that a consumer may keep after its step.
    const BORROWED: usize;
    /// Largest number of rows of a message. Every slot has this size; memory that is never written is never allocated.
    const MAX_ROWS: usize;
    /// Whether every number of every row must be finite; numbers of the header always must be. It is checked when a
    /// message is published, so only topics with few rows set it.
    const FINITE_ROWS: bool = false;
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
