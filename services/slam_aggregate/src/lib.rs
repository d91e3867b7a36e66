//! Stage `slam_aggregate`: deskews sweeps, registers them, aggregates submaps, and places the submaps in the world at the end
//! (thesis section 2.5.1).
//!
//! Odometry is in [`registration`], the pose graph in [`georeference`]; this stage connects them to topics and saved state.
//!
//! Odom is the body frame at the first shot of the drive, tilt included: its z axis is the body's z axis at that time.
//! Poses on the topics are `odom_from_body` (trajectory), `odom_from_submap` (header of a submap) and
//! `submap_from_lidar` (sweep table of a submap), in metres. The frame of a submap has the position and heading of the
//! body at its first shot. Its z axis is parallel to the z axis of odom, so differences of height are the same in both.
//!
//! At the end of the stream, topic `placement` has the poses of the submaps from all measurements: GNSS, gravity and
//! loop closures move the submaps, never their points (`docs/explanation/georeferencing.md`).
//!
//! With `path = "given"` odom is the world: sweeps are placed by the trajectory that drive.toml names, and nothing is matched.
//!
//! The first sweep waits for the second, because a speed needs two sweeps: its poses are one tick late.
//!
//! Start at [`SlamAggregate`] in `slam.rs`: one step matches a sweep, writes its points and closes a submap.
//! `open_submap.rs` has the growing submap, in shared memory.
//!
//! The stage must never move a point that it has published, never publish a submap twice, and never use a measurement that arrives later
//! than the tick of its sweep: the same ticks give the same bytes.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod incoming;
mod open_submap;
mod path_use;
mod saved;
mod settings;
mod slam;

pub use georeference::{Correction, PathSource};
pub use registration::{MotionSensor, OdometryAlgorithm};
pub use settings::Settings;
pub use slam::SlamAggregate;
