//! Scores of results against ground truth.
//!
//! | result | item |
//! |---|---|
//! | classes of points: confusion matrix, precision, recall, intersection over union | [`Confusion`], [`ClassScores`], [`ScoreTable`] |
//! | instances: panoptic quality and its parts, matched share | [`Overlaps`], [`InstanceScores`] |
//! | trajectories: absolute, relative and segment errors, alignment | [`trajectory`] |
//! | point clouds: sharpness, distance to a true cloud | [`map`] |
//! | images and superpixels: fidelity, boundaries, shapes | [`fidelity`], [`regions`] |
//! | a list of errors: mean, RMS, percentiles | [`Statistics`] |
//!
//! Formulas and the other programs that give the same numbers: `docs/reference/measures.md`.
//!
//! This crate must never read a file, depend on a model or a stage, or substitute a score if there is no truth: such a
//! score is NaN or `None`. The caller provides labels, poses and points in memory.
//!
//! Start reading at [`Confusion`], the simplest score; [`trajectory`] has the most conventions.

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
