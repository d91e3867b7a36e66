//! Simulated drives: procedural towns, the L3D2 rig that drives through them, and the truth about both.
//!
//! | module | says |
//! |---|---|
//! | [`scene`] | what there is: surfaces with class, instance and material, standing and moving |
//! | [`trace`] | what a ray meets |
//! | [`spectrum`], [`material`], [`light`] | how surfaces look at each wavelength |
//! | [`motion`], [`rig`] | where the vehicle and its sensors are |
//! | [`sensors`] | what each sensor records of it, with its own noise |
//! | [`truth`] | what the recording should be understood as |
//! | [`write_drive`] | all of it as a drive folder |
//!
//! Equal [`DriveSpec`]s give equal bytes, whatever the number of threads: every random number is a hash of the seed and of
//! the place where it is used, and parallel work never shares a sum.
//!
//! Frames and units follow `docs/conventions.md`; the world is local east-north-up around [`sensors::gnss::ORIGIN`].

mod drive;
mod error;
pub mod light;
pub mod material;
pub mod motion;
mod noise;
mod pace;
mod random;
pub mod rig;
pub mod scene;
pub mod sensors;
mod spec;
pub mod spectrum;
mod spline;
pub mod trace;
pub mod truth;
mod way;

pub use drive::{Simulation, write_drive};
pub use error::SimulationError;
pub use pace::{Driver, Pace};
pub use spec::{DriveReport, DriveSpec, Town};
pub use way::Way;
