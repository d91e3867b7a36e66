//! Scores of results against ground truth: classes and instances of points, trajectories, point clouds, images and their regions. This crate reads no files
//! and needs no model.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod classes;
mod image;
mod instances;
pub mod map;
pub mod regions;
mod statistics;
pub mod trajectory;

pub use classes::{ClassScores, Confusion, ScoreTable};
pub use image::{Fidelity, fidelity, fidelity_where};
pub use instances::{InstanceScores, Overlaps, PointLabel};
pub use statistics::Statistics;
