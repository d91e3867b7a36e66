//! Every topic has a tick channel. It reports complete ticks, barriers and the end of the stream.

use crate::{Message, NoHeader, pod};

pod! {
    /// Everything of one tick has been published on the topic. 48 bytes.
    ///
    /// | offset | field | meaning |
    /// |---|---|---|
    /// | 0 | `tick` | 0, 1, 2 … |
    /// | 8 | `n_published` | messages of the topic up to and including this tick |
    /// | 16 | `barrier` | number of the barrier after this tick, from 1; 0 = none |
    /// | 24 | `drive_time` | ns since the Unix epoch at the source; [`NO_DRIVE_TIME`] before its first data |
    /// | 32 | `born_nanos` | monotonic clock when the source began the tick |
    /// | 40 | `progress` | share of the drive that the source has read, 0 to 1 |
    /// | 44 | `end` | 1: nothing follows |
    pub struct TickRow {
        /// Number of the tick.
        pub tick: u64,
        /// Messages of the topic so far.
        pub n_published: u64,
        /// Number of the barrier after this tick, 0 = none.
        pub barrier: u64,
        /// ns since the Unix epoch at the source.
        pub drive_time: i64,
        /// Monotonic clock when the source began the tick. For latency figures only.
        pub born_nanos: u64,
        /// Share of the drive that the source has read.
        pub progress: f32,
        /// 1: nothing follows.
        pub end: u32,
    }
}

/// The drive's time before a live source has any data.
pub const NO_DRIVE_TIME: i64 = i64::MIN;

/// The tick channel of a topic.
pub struct TickTopic;
impl Message for TickTopic {
    const TOPIC: &'static str = "tick";
    const VERSION: u32 = 1;
    // How many ticks a producer may run ahead: 6.4 s of drive at 10 Hz, longer than a submap of 5 s. The next submap is
    // thus made while the later stages process the previous one.
    const QUEUE: usize = 64;
    const BORROWED: usize = 1;
    const MAX_ROWS: usize = 1;
    type Header = NoHeader;
    type Row = TickRow;
}
