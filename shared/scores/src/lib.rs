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
//! What it must never do: read a file, know a model or a stage, or substitute a score where there is no truth: such a score is NaN or
//! `None`. The caller brings labels, poses and points in memory.
//!
//! Where to begin reading: [`Confusion`] is the simplest; [`trajectory`] has the most conventions.

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
