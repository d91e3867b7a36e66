//! How well a labelling of points agrees with the truth. Counts alone: no files, no models, no dependencies, so that whoever
//! scores something need not build what made it.

mod panoptic;

pub use panoptic::{ClassScore, Overlaps, PointLabel};
