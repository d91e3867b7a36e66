//! LiDAR sensors of all makers: packets, models, calibration files, and sweeps from packet captures.
//!
//! A maker has a module with its packets, models and tables: [`velodyne`], [`hesai`], [`ouster`], [`robosense`] and [`livox`]. The rest of
//! the crate is the same for all: [`pcap`] reads and writes captures, [`SweepReader`] finds the packets of a sensor in a capture, orders
//! them by the clock of the sensor, and splits them into sweeps: revolutions, or equal pieces of time for sensors that do not rotate.
//! [`PacketDecoder`] does the same for packets that arrive over UDP. [`nmea`] reads the sentences of GNSS receivers, which also travel in
//! position packets.
//!
//! **Frame.** x forward, y left, z up, m. An encoder angle of 0 looks along +x, 90 deg to the right, along -y. Rings count from the lowest
//! beam.
//!
//! **Never**: clouds in files, drive folders, clocks of this computer. Lost, short, repeated and foreign packets are
//! counted in [`LidarStats`]; they are not errors.
//!
//! **Start reading** at [`PacketDecoder::decode_into`], then [`SweepReader::next_sweep`]; [`velodyne`] is the example of a maker.

mod arc_tangent;
mod blocks;
mod calibration;
mod capture;
mod clock;
mod clock_reference;
mod decoder;
mod detect;
mod directions;
mod field_of_view;
pub mod hesai;
pub mod livox;
mod maker;
mod model;
pub mod nmea;
mod other_model;
pub mod ouster;
pub mod pcap;
mod receiver;
mod reorder;
mod revolutions;
mod ring_order;
pub mod robosense;
mod scratch;
mod sensor;
mod source;
mod stats;
mod sweeps;
mod turn_table;
pub mod velodyne;

pub use arc_tangent::fast_atan2;
pub use calibration::CalibrationError;
pub use clock_reference::ClockReference;
pub use decoder::PacketDecoder;
pub use directions::Directions;
pub use messages::SweepPoint;
pub use model::Model;
pub use other_model::OtherModel;
pub use ring_order::{OrderedRings, rings_by_order};
pub use sensor::{Lidar, Origin};
pub use stats::LidarStats;
pub use sweeps::{PacketArrival, SliceInfo, SlicePoll, SweepError, SweepInfo, SweepPoll, SweepPosition, SweepReader};

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
