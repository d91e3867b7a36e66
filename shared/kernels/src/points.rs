//! Operations on rows of points, with derivatives: tensors have a row for each point and a column for each channel.
//!
//! All results and gradients are the same for every number of threads: one thread computes a row, and sums over rows
//! have fixed parts.

mod activation;
mod concatenate;
mod layer;
mod linear;
mod lists;
mod maximum;
mod neighbor_maximum;
mod normalize;
mod normalized_means;
mod plane;
mod product;
mod residual_layers;
mod rows;
mod tap_convolution;
mod taps;
mod weighted_sum;

pub use activation::{Activation, add_activated};
pub use concatenate::concatenate;
pub use layer::Layer;
pub use linear::linear;
pub use lists::Lists;
pub use maximum::maximum;
pub use neighbor_maximum::neighbor_maximum;
pub use normalize::{ColumnStatistics, Normalization, Source, normalize};
pub use normalized_means::normalized_means;
pub use plane::{PlaneShape, depth_wise_convolution, plane_convolution};
pub use residual_layers::add_residual_layers;
pub use rows::tensor;
pub use tap_convolution::kernel_point_convolution;
pub use taps::{KernelPoints, Neighborhood};
pub use weighted_sum::weighted_sum;
