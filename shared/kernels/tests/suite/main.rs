//! Kernels compared with their definitions.

mod convolution;
mod point_gradients;
mod tensors;
