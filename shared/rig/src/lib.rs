//! The rig of a drive: made from third-party calibrations, checked against the recorded data, and refined by it.
//!
//! | idea | module |
//! |---|---|
//! | one pass over a drive: the motion by the LiDAR alone, outlines, ground, samples | [`survey`] |
//! | whether the rig fits the data, and what does not | [`check`] |
//! | pictures of points over images and of sweeps over each other | [`picture`] |
//! | rotations and elevations that fit the drive better | [`refine`] |
//! | mounting of one LiDAR against another | `secondary_lidar` |
//! | delay of a receiver | `receiver_delay` |
//! | rotations as people write them | [`rotation`] |
//! | third-party calibrations | [`source`] |
//! | errors | [`error`] |
//!
//! A rig is a `drive.toml` with mountings, time offsets and camera models of all sensors. This crate finds out whether it is
//! right; it must never change a drive folder by itself: [`refine`] returns a new manifest with the reason for each change, and
//! the caller writes it. A value that the drive does not determine stays as it is, and is reported as not observable. All
//! mountings are `body_from_sensor`, in m and rad, as in `docs/reference/conventions.md`.
//!
//! Begin with [`survey`], which reads the drive once; [`check`] and [`refine`] have one file for each kind of sensor and judge
//! what it collected. Calibrations by third parties come in by [`source`]. The commands are `replica rig new`, `check` and
//! `refine` (`docs/guide/rig.md`).

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
