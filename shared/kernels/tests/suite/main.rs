//! Kernels against their definitions.

mod convolution;
mod point_gradients;
mod tensors;
