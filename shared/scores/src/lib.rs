//! Scores of results against ground truth: classes and instances of points, trajectories, point clouds. This crate reads no files
//! and needs no model.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod classes;
mod instances;
pub mod map;
mod statistics;
pub mod trajectory;

pub use classes::{ClassScores, Confusion, ScoreTable};
pub use instances::{InstanceScores, Overlaps, PointLabel};
pub use statistics::Statistics;
