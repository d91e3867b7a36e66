//! The vehicle: its sensors, their mountings and their accuracy.
//!
//! A rig file (`shared/simulation/rigs/README.md`) describes one rig; [`RigSpec::built_in_names`] lists the built-in
//! rigs. The body frame has x forward, y left, z up, and its origin is `body_height_m` above the road.

mod built_in;
mod calibration;
mod file;
mod spec;

pub use crate::sensors::gnss::GnssSpec;
pub use crate::sensors::imu::ImuSpec;
pub use crate::sensors::trigger::TriggerSpec;
pub use calibration::CalibrationError;
pub use spec::{CameraSpec, LidarSpec, MosaicSpec, OtherLidarSpec, RigSpec};
