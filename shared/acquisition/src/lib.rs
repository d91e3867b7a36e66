//! Sweeps and the measurements of all other sensors, from a recorded drive or from a vehicle on the network.
//!
//! | content | module |
//! |---|---|
//! | a vehicle on the network: received, recorded, decoded from the growing recording | [`live`] |
//! | a recorded drive in ticks: a sweep, and the measurements of the other sensors up to its end | [`recorded`] |
//! | doubts about the data | [`doubts`], [`counters`] |
//! | rows and headers of messages from decoded data | [`rows`] |
//!
//! Three terms: the *first LiDAR* gives ticks and trajectory. The data of *secondary LiDARs* is cut at its sweeps
//! (`secondary_lidar`, `secondary_lidars`, `secondary_tally`). *Auxiliary sensors* are cameras, GNSS receiver and IMU
//! (`live/auxiliary`).
//!
//! The caller provides the memory of points, images and mosaics: this crate must never copy them, and it does not
//! depend on a transport. It must never stop at damaged data: it counts, reports once and skips damage, and a share
//! above its limit is a doubt. Live, only recorded data is decoded, so that a run on the recording gives the same
//! sweeps. Stamps are ns since the Unix epoch by the clock of each sensor; live, offsets between clocks are reported,
//! not corrected.
//!
//! Start with `recorded/drive_reader.rs` for a recorded drive and `live/vehicle.rs` for a live one; the stage `acquire`
//! drives both.

pub mod counters;
pub mod doubts;
pub mod error;
pub mod live;
pub mod recorded;
pub mod rows;
mod secondary_tally;
