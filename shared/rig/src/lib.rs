//! The rig of a drive: made from calibrations of others, checked against the recorded data, and refined by it.
//!
//! | idea | module |
//! |---|---|
//! | one pass over a drive: the motion by the LiDAR alone, outlines, ground, samples | [`survey`] |
//! | whether the rig fits the data, and what does not | [`check`] |
//! | errors | [`error`] |

pub mod check;
pub mod error;
pub mod rotation;
pub mod survey;
