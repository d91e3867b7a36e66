//! Training of the networks of the crate `segmentation`.
//!
//! [`Trainer`] draws batches from a [`Dataset`], computes a [`Loss`] and its derivatives, and updates the variables with
//! [`Adam`]. After each epoch it validates, keeps the best weights, and can write a checkpoint from which training
//! resumes exactly. [`Network`] is the interface of the loop:
//!
//! | network | derivatives | variables |
//! |---|---|---|
//! | [`ImageNetwork`] on a CPU | [`Differential`] runs the kernels and records them ([`derivatives`]) | [`Variables`]: standardized filters |
//! | [`ImageNetwork`] on a GPU | candle differentiates its own operations | the same |
//! | [`PointNetwork`] | candle differentiates the kernels on points, which have their derivatives | `segmentation::points::Parameters` |
//!
//! Data: [`Example`] is a labeled image, [`PointExample`] a labeled sphere of points. [`TrainingSpheres`] draws the
//! centers of spheres, [`ClassifiedCells`] reduces a labeled submap to cells, and [`Augmentation`] augments spheres at
//! random. [`draw_examples`] draws the labeled pixels that can replace the last layer. [`fit_priors`]
//! fits the priors of a fused model.
//!
//! A training is a function of its settings, data and seed: an interrupted and resumed training gives the same bytes, for
//! every number of threads. This crate never reads a clock or a file, simulates a town or depends on a recipe: a
//! checkpoint is bytes. No stage may use it: code for inference belongs to `segmentation` or `kernels`.
//!
//! Where to start reading: `trainer.rs` has the loop, `network.rs` its interface, `criterion.rs` the loss of a batch, and
//! `point_network.rs` the shortest complete network.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod adam;
mod bev_head;
mod class_priors;
mod class_rows;
mod classified_cells;
mod criterion;
mod curves;
mod dataset;
pub mod derivatives;
mod device_network;
mod device_pass;
mod differential;
mod error;
mod image_network;
mod losses;
mod nearest_examples;
mod network;
mod pixels;
mod point_augmentation;
mod point_network;
mod trainer;
mod training_spheres;
mod variables;
mod views;

pub use adam::Adam;
pub use bev_head::BevHead;
pub use class_priors::{LabeledMeans, fit_priors};
pub use class_rows::{ClassLayer, match_classes};
pub use classified_cells::{ClassifiedCells, classes_of_cells};
pub use criterion::Criterion;
pub use curves::{BestEpoch, Curves, Epoch};
pub use dataset::{BevLabels, Dataset, Example, NO_CELL, PointExample, SparseView, UNKNOWN};
pub use differential::{Differential, InputDerivatives, Recording};
pub use error::TrainingError;
pub use image_network::ImageNetwork;
pub use losses::{Hierarchy, Loss, consistency};
pub use nearest_examples::draw_examples;
pub use network::{Derivatives, LabeledLogits, LabeledLogitsResult, Network};
pub use point_augmentation::{Augmentation, Elastic, add_noise, distort, rotate, scale};
pub use point_network::PointNetwork;
pub use trainer::{Evaluation, Progress, TrainSettings, Trainer};
pub use training_spheres::{DrawnItem, TrainingSpheres};
pub use variables::Variables;
