//! Sweeps and the measurements of all other sensors, from a recorded drive or from a vehicle on the network.
//!
//! | idea | module |
//! |---|---|
//! | a vehicle on the network: received, recorded, decoded from the growing recording | [`live`] |
//! | a recorded drive in ticks: a sweep, and what the other sensors measured up to its end | [`recorded`] |
//! | how far the data can be trusted | [`doubts`], [`counters`] |
//! | rows and headers of messages from decoded data | [`rows`] |
//!
//! Three words: the *first LiDAR* gives ticks and trajectory. *Secondary LiDARs* are cut at its sweeps (`secondary_lidar`,
//! `secondary_lidars`, `secondary_tally`). *Auxiliary sensors* are cameras, GNSS receiver and IMU (`live/auxiliary`).
//!
//! The caller provides the memory of points, images and mosaics: this crate must never copy them, and knows no topic's
//! transport. It must never stop at damaged data: that is counted, reported once and skipped, and a share above its limit is a
//! doubt. Live, nothing is decoded that was not recorded before, so that a run on the recording gives the same sweeps. Stamps
//! are ns since the Unix epoch by the clock of each sensor; live, offsets between clocks are reported, not corrected.
//!
//! Begin with `recorded/drive_reader.rs` for a recorded drive and `live/vehicle.rs` for a live one; both are driven by the
//! stage `acquire`.

pub mod counters;
pub mod doubts;
pub mod error;
pub mod live;
pub mod recorded;
pub mod rows;
mod secondary_tally;
