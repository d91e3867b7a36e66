//! Simulated drives: a rig of sensors on a vehicle in a procedural town, and the ground truth of the recording.
//!
//! | module | content |
//! |---|---|
//! | [`motion`] | pose of the ego vehicle over time |
//! | [`rig`] | sensors of the vehicle and their mountings |
//! | [`light`], [`illuminants`] | sun and sky |
//! | [`sensors`] | what each sensor records, with its noise |
//! | [`truth`] | ground truth poses and labels |
//! | [`write_drive`] | all of it as a drive folder |
//!
//! Equal [`DriveSpec`]s give equal bytes for any number of threads: every random number is a hash of the seed and of the
//! place where it is used, and parallel work never shares a sum.
//!
//! The crate must never read a clock or the environment, or depend on a stage or a run: its drives are folders like
//! recorded ones. Ground truth is written next to them and never used for a measurement. Scenes and their surfaces belong
//! to `town`, rays to `raytrace`.
//!
//! Start with [`DriveSettings`] (user choices) and [`DriveSpec`] (the same, resolved), then [`write_drive`]; each sensor
//! is one module below [`sensors`].
//!
//! Frames and units follow `docs/reference/conventions.md`; the world is local east-north-up around [`sensors::gnss::ORIGIN`].

mod drive;
mod drive_settings;
mod error;
pub mod illuminants;
pub mod light;
pub mod limits;
pub mod motion;
pub mod rig;
pub mod sensors;
mod simulation;
mod spec;
pub mod truth;

pub use drive::{SimulatedDrive, write_drive, write_simulation};
pub use drive_settings::DriveSettings;
pub use error::SimulationError;
pub use limits::OutOfLimits;
pub use rig::{CalibrationError, RigSpec};
pub use sensors::lidar::LidarGrade;
pub use simulation::Simulation;
pub use spec::{ClassRate, DriveReport, DriveSpec};
pub use town::{Town, Traffic};
