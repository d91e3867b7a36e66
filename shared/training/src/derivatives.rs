//! Derivatives of the kernels of `kernels::images`.

mod convolution;
mod resample;

pub use convolution::{input_gradient, transposed_filters, weight_gradient};
pub use resample::{max_pool_gradient, upsample_gradient};
