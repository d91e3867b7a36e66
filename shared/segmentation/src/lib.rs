//! Semantic segmentation of submaps: a class and a score for every point.
//!
//! [`load()`] reads a model file and returns a [`Segmenter`]. The file names the architecture of the model:
//!
//! | architecture | module | model |
//! |---|---|---|
//! | `fused` | [`fused`] | two of the models below as one: the weighted geometric mean of their probabilities. The default, `street_fused.safetensors`, is a U-Net on range images and a `WaffleIron` on points |
//! | `spherical` | [`spherical`] | a network on range images, back-projection, votes of all sweeps |
//! | `points` | [`points`] | a network on points, in spheres or squares that vote |
//! | `ground_quasi_flat` | [`ground_quasi_flat`] | ground by mathematical morphology, without a network (crate `ground`) |
//!
//! A network is a graph of candle tensors ([`network`] on images, [`points`] on points). Its fast operations are in the crate `kernels`,
//! the terrain below a submap is in the crate `ground`, and everything only needed for training in the crate
//! `training`.
//!
//! | shared by all models | module |
//! |---|---|
//! | model files, and the part of a fused file | [`ModelFile`], [`encode_model`] |
//! | probabilities in cells of the submap | [`CellProbabilities`] |
//! | the scale of the intensities of a LiDAR | [`intensity`] |
//! | corrections of classes, points without a class | [`Refinement`], [`UnknownBelow`] |
//! | options of a run that are not part of the model | [`Options`], [`ComputeDevice`] |
//!
//! Equal submaps and models give equal classes and scores on every CPU, for every number of threads and every batch size; only a GPU
//! rounds differently. A model never reads a clock, the environment or a file after it is loaded. It never invents a
//! class: class names come from the model file and must be in the class table of `messages`. Every score and every
//! class byte depends on the order of floating-point operations here, so a change of this order is a new version of the
//! architecture.
//!
//! Where to start reading: `segmenter.rs` has the interface of all models, `load.rs` the list of architectures, and
//! `spherical/model.rs` and `points/model.rs` a complete model each. A new architecture is a module and a line in
//! [`load()`].

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod cell_probabilities;
mod class_rows;
mod compute_device;
mod decision;
mod driven_path;
mod error;
pub mod fused;
pub mod ground_quasi_flat;
pub mod intensity;
mod lidar_above_ground;
mod load;
mod model_file;
pub mod network;
mod options;
pub mod points;
mod refinement;
mod sample;
mod segmenter;
mod settings_rules;
pub mod spherical;
mod sweep_positions;
mod unknown_below;
mod vehicle_shape;
mod views;

pub use cell_probabilities::CellProbabilities;
pub use compute_device::ComputeDevice;
pub use error::SegmentationError;
pub use fused::{Fused, Fusion, fuse};
pub use lidar_above_ground::{LidarAboveGround, MountingFault};
pub use load::{asked_columns, load, notices};
pub use model_file::{MAX_MODEL_BYTES, ModelCard, ModelFile, encode_model};
pub use options::Options;
pub use refinement::Refinement;
pub use segmenter::{CellSegmenter, ModelInput, Report, Segmenter, SpectraColumn, SubmapProbabilities};
pub use unknown_below::UnknownBelow;
pub use views::MOST_VIEWS;
