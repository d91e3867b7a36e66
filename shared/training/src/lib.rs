//! Training of the networks of the crate `segmentation`.
//!
//! [`Trainer`] draws batches from a [`Dataset`], computes a [`Loss`] and its derivatives ([`Differential`] runs a network on the
//! kernels of `segmentation` and records it), and changes [`Variables`] with [`Adam`]. After each epoch it validates, keeps the
//! best weights, and can write a checkpoint from which training resumes exactly.

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
pub use curves::{Curves, Epoch};
pub use dataset::{BevLabels, Dataset, Example, NO_CELL, PointExample, SparseView, UNKNOWN};
pub use differential::{Differential, OfLayer, Recording};
pub use error::TrainingError;
pub use image_network::ImageNetwork;
pub use losses::{Hierarchy, Loss, consistency};
pub use nearest_examples::NearestExamples;
pub use network::{Derivatives, LabeledLogits, Network};
pub use point_augmentation::{Augmentation, Elastic, add_noise, distort, rotate, scale};
pub use point_network::PointNetwork;
pub use trainer::{Progress, TrainSettings, Trainer};
pub use training_spheres::TrainingSpheres;
pub use variables::Variables;
