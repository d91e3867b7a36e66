//! The kernels of [`crate::engine`] as candle operations with derivatives: what networks train on.
//!
//! An image is a tensor of five dimensions: batch, block of 16 channels, row, column, channel of the block. Images of a
//! batch are worked on side by side; sums over the batch have its order, so threads do not show in the result.

mod convolution;
mod pack;
mod resample;
mod tensors;

pub use convolution::convolution;
pub use pack::pack;
pub use resample::{max_pool, upsample};
pub use tensors::{image_from_rows, rows_from_image};
