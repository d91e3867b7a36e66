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
mod criterion;
mod curves;
pub mod derivatives;
mod device_pass;
mod differential;
mod error;
mod image_network;
mod losses;
mod network;
mod pixels;
mod point_network;
mod trainer;
mod variables;
mod views;

pub use adam::Adam;
pub use bev_head::BevHead;
pub use class_priors::{LabeledMeans, fit_priors};
pub use class_rows::{ClassLayer, match_classes};
pub use criterion::Criterion;
pub use curves::{Curves, Epoch};
pub use differential::{Differential, OfLayer, Recording};
pub use error::TrainingError;
pub use image_network::ImageNetwork;
pub use losses::{Hierarchy, Loss, consistency};
pub use network::{Derivatives, LabeledLogits, Network};
pub use point_network::PointNetwork;
pub use segmentation::{BevLabels, Dataset, Example, NO_CELL, PointExample, SparseView, UNKNOWN};
pub use trainer::{Progress, TrainSettings, Trainer};
pub use variables::Variables;
