//! How well results agree with the truth: labels of points, trajectories, maps. No files and no models, so that whoever scores
//! something need not build what made it.

pub mod map;
mod panoptic;
mod statistics;
pub mod trajectory;

pub use panoptic::{ClassScore, Overlaps, PointLabel};
pub use statistics::Statistics;
