//! Convolution on a CPU: images in blocks of 16 channels, kernels that keep their sums in registers.
//!
//! candle's convolution unrolls the image into a matrix on one thread and is 16 to 20 times slower than that of ONNX
//! Runtime. The kernels here read the image where it lies; the same ones infer and train.
//! They choose their instructions when they run (AVX-512, AVX2 or none, by `pulp`). A sum has the same order on each, one
//! fused multiply-add after another, so the instructions do not show in the result.

mod convolution;
mod gradient;
mod planes;
mod resample;
mod winograd;

pub use convolution::{Filter, Shape, convolve};
pub use gradient::{input_gradient, weight_gradient};
pub use planes::{BORDER, Border, Feature, LANES, Planes, blocks};
pub use resample::{max_pool, max_pool_gradient, upsample, upsample_gradient};
