//! Stage `slam_aggregate`: deskews sweeps, finds where the vehicle was, and aggregates submaps (thesis section 2.5.1).
//!
//! World: the body frame at the first shot of the drive, z up as the body's then; metres. Poses on the topics are
//! `world_from_body` (trajectory) and `submap_from_lidar` (sweep table of a submap). A submap lies where the body was
//! at its first shot and is turned with it about z alone, so that heights in it are heights in the world.
//!
//! At the end of the stream topic `placement` says where the submaps lie once everything has been seen: fixes, gravity and
//! places that were passed twice move the submaps' poses, never their points (`docs/georeference.md`).
//!
//! The first sweep waits for the second, because a speed needs two: its poses come one tick late.

mod drift;
mod drive_graph;
mod fixes;
mod gravity;
mod odometry_settings;
mod open_submap;
mod receiver_errors;
mod recent_path;
mod saved;
mod settings;
mod slam;
mod sweeps;
mod weak_stretches;

pub use settings::Settings;
pub use slam::SlamAggregate;
