//! The rig of a drive: made from third-party calibrations, checked against the recorded data, and refined by it.
//!
//! | idea | module |
//! |---|---|
//! | one pass over a drive: motion from the LiDAR alone, outlines, ground, samples | [`survey`] |
//! | checks whether the rig fits the data, and what does not fit | [`check`] |
//! | pictures of points over images and of sweeps over each other | [`picture`] |
//! | rotations and elevations that fit the drive better | [`refine`] |
//! | mounting of one LiDAR relative to another | `secondary_lidar` |
//! | mounting of the first LiDAR from passes along given paths | `boresight` |
//! | delay of a receiver | `receiver_delay` |
//! | rotations in their usual notations | [`rotation`] |
//! | third-party calibrations | [`source`] |
//! | errors | [`error`] |
//!
//! A rig is a `drive.toml` with mountings, time offsets and camera models of all sensors. This crate checks whether it
//! is correct. It must never change a drive folder by itself: [`refine`] returns a new manifest with the reason for
//! each change, and the caller writes it. A value that the drive does not determine is kept, and is reported as not
//! observable. All mountings are `body_from_sensor`, in m and rad, as in `docs/reference/conventions.md`.
//!
//! Start reading at [`survey`], which reads the drive once; [`check`] and [`refine`] have one file for each kind of
//! sensor and evaluate the data of the survey. [`source`] imports third-party calibrations. The commands are
//! `replica rig new`, `check` and `refine` (`docs/guide/rig.md`).

mod boresight;
pub mod check;
pub mod error;
pub mod picture;
mod receiver_delay;
pub mod refine;
pub mod rotation;
mod secondary_lidar;
pub mod source;
pub mod survey;
mod yaml;
