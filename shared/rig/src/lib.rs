//! The rig of a drive: made from calibrations of others, checked against the recorded data, and refined by it.
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
//! | calibrations of others | [`source`] |
//! | errors | [`error`] |

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
