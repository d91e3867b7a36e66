//! Post-processed trajectories: the path of the vehicle from Applanix, `NovAtel`, `Inertial Explorer`, or another
//! odometry, for runs that place the points by it (`docs/reference/drive_folder.md`).
//!
//! | module | content |
//! |---|---|
//! | `decode` | files of all formats as times, places and attitudes in their own terms |
//! | `clock` | weeks, days, leap seconds: times in UTC |
//! | `frame` | places and attitudes in the world frame, pose of the body |
//! | `path` | [`GivenPath`]: poses of the body with their deviations, gaps |
//! | `check` | [`check`]: comparison with the sensors of the drive |
//!
//! Start reading at [`GivenPath::from_drive`], then [`check`].
//!
//! This crate must never guess: what neither the file nor `drive.toml` says is a problem that names the key, and a path
//! that contradicts the drive is refused with the reading that would fit. It uses no clock, and reads only the files of
//! the drive.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod check;
mod clock;
mod decode;
mod frame;
mod path;

pub use check::{Evidence, Findings, check};
pub use path::{ASSUMED_DEG, ASSUMED_M, Deviation, Gap, GivenPath};
