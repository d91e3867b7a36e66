//! Stage `slam_aggregate`: deskews sweeps, finds where the vehicle was, and aggregates submaps (thesis section 2.5.1).
//!
//! World: the body frame at the first shot of the drive, z up as the body's then; metres. Poses on the topics are
//! `world_from_body` (trajectory) and `submap_from_lidar` (sweep table of a submap). A submap lies where the body was
//! at its first shot and is turned with it about z alone, so that heights in it are heights in the world.
//!
//! The first sweep waits for the second, because a speed needs two: its poses come one tick late.

mod odometry_settings;
mod open_submap;
mod saved;
mod settings;
mod slam;
mod sweeps;
mod weak_stretches;

pub use settings::Settings;
pub use slam::SlamAggregate;
