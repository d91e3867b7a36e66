//! Sweeps and the measurements of other sensors, from a recorded drive or from a LiDAR on the network.
//!
//! | idea | module |
//! |---|---|
//! | a LiDAR on the network: received, recorded, decoded from the growing recording | [`live`] |
//! | a recorded drive in ticks: a sweep, and what the other sensors measured up to its end | [`recorded`] |
//! | how far the data can be trusted | [`doubts`], [`counters`] |
//! | rows and headers of messages from decoded data | [`rows`] |
//!
//! The caller provides the memory of points, images and mosaics.

pub mod counters;
pub mod doubts;
pub mod error;
pub mod live;
pub mod recorded;
pub mod rows;
mod secondary_tally;
