//! Convolution on a CPU: images in blocks of 16 channels, kernels that keep their sums in registers.
//!
//! The convolution of candle copies the image into a matrix (im2col) on one thread and is 16 to 20 times slower than
//! the convolution of ONNX Runtime. These kernels read the image in place. They are operations of candle ([`ops`]) on
//! images in tensors ([`tensors`]), so they can be combined with other operations of candle. Rows above and below an
//! image and padding channels must stay zero: only element-wise operations that map zero to zero can be applied
//! directly to these tensors (`relu`, sums and products of tensors). For all other operations,
//! [`FromBlocks`](tensors::FromBlocks) and [`ToBlocks`](tensors::ToBlocks) convert to and from the order of `PyTorch`.
//!
//! Inference and training use the same kernels (derivatives are in the crate `training`). `pulp` selects the instruction set at run
//! time (AVX-512, AVX2 or none). The order of additions is the same for all of them, one fused multiply-add after another, so the
//! instruction set does not change the result.

mod convolution;
mod direct;
mod filter;
pub mod ops;
mod planes;
mod products;
mod resample;
mod shape;
pub mod tensors;
mod winograd;
mod winograd_filter;

pub use convolution::convolve;
pub use filter::Filter;
pub use planes::{BORDER, Border, Feature, LANES, Planes, PlanesMut, PlanesRef, blocks};
pub use resample::{max_pool, upsample};
pub use shape::{FilterPosition, PlainFilter, Shape};
