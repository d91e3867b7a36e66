//! Semantic segmentation of submaps: a class and a score for every point.
//!
//! [`load()`] reads a model file and returns a [`Segmenter`]. The file names the architecture of the model:
//!
//! | architecture | module |
//! |---|---|
//! | `ground_quasi_flat` | [`ground_quasi_flat`]: ground by mathematical morphology, no training |
//! | `points` | [`points`]: a network on points, in spheres that vote |
//! | `spherical` | [`spherical`]: a network on range images, back-projection, votes of all sweeps |
//!
//! A further architecture is a module and a line in [`load()`]. Training is in the crate `training`; both run the same kernels
//! ([`kernels`]).

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod cell_probabilities;
mod class_rows;
mod compute_device;
mod error;
mod fused;
pub mod ground_quasi_flat;
pub mod intensity;
mod load;
mod model_file;
pub mod network;
mod options;
pub mod points;
mod refinement;
mod segmenter;
mod settings_rules;
pub mod spherical;
mod unknown_below;

pub use cell_probabilities::CellProbabilities;
pub use compute_device::ComputeDevice;
pub use error::SegmentationError;
pub use fused::{Fused, Fusion, fuse};
pub use load::{asked_columns, load};
pub use model_file::{MAX_MODEL_BYTES, ModelCard, ModelFile, encode_model};
pub use options::Options;
pub use refinement::Refinement;
pub use segmenter::{CellSegmenter, ModelInput, Report, Segmenter};
pub use unknown_below::UnknownBelow;
