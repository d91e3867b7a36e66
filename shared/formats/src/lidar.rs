//! LiDAR sensors of all makers: models, calibration files, and sweeps from packet captures.
//!
//! Each maker has a module that decodes its packets: [`crate::velodyne`], [`crate::hesai`], [`crate::ouster`], [`crate::robosense`] and
//! [`crate::livox`]. This module finds the packets of a sensor in a recording, orders them by the clock of the sensor, and splits them
//! into sweeps: revolutions, or equal pieces of time for sensors that do not rotate.
//!
//! **Frame.** x forward, y left, z up. An encoder angle of 0 looks along +x, 90 deg to the right, along -y.

mod blocks;
mod calibration;
mod capture;
mod clock;
mod clock_reference;
mod decoder;
mod detect;
mod model;
mod other_model;
mod receiver;
mod reorder;
mod revolutions;
mod scratch;
mod stats;
mod sweeps;
mod turn_table;

pub use calibration::{CalibrationError, Lidar, Origin};
pub use clock_reference::ClockReference;
pub use decoder::PacketDecoder;
pub use messages::SweepPoint;
pub use model::Model;
pub use other_model::OtherModel;
pub use stats::LidarStats;
pub use sweeps::{SliceInfo, SlicePoll, SweepError, SweepInfo, SweepPoll, SweepPosition, SweepReader};

pub(crate) use blocks::{Blocks, MAX_BLOCKS};
pub(crate) use calibration::BeamAngles;
pub(crate) use scratch::Scratch;
pub(crate) use turn_table::{TurnTable, azimuth_of};

/// Encoder counts per revolution, 0.01 deg each.
pub(crate) const TURN: u16 = 36_000;

/// Ring of each beam: its rank by elevation, 0 = lowest.
pub(crate) fn rings(elevations_deg: impl Iterator<Item = f64>) -> Vec<u8> {
    let elevations_deg: Vec<f64> = elevations_deg.collect();
    let below = |elevation: &f64| elevations_deg.iter().filter(|other| *other < elevation).count() as u8;
    elevations_deg.iter().map(below).collect()
}
