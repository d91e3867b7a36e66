//! Networks on images as lists of layers that any [`Executor`] runs: [`Inference`] here, as operations of candle on
//! tensors, and the derivatives in the crate `training`.
//!
//! [`NetworkSpec`] names an architecture and runs it, [`Weights`] has its values, and [`Inference`] combines both for
//! prediction.

mod blocked;
mod executor;
mod inference;
mod layer;
pub mod on_device;
mod published;
mod spec;
mod unet;
mod weights;

pub use blocked::{ImagePool, PooledImage};
pub use executor::Executor;
pub use inference::Inference;
pub use layer::{CLASS_LAYER, Layer, TensorShape};
pub use spec::NetworkSpec;
pub use weights::{WeightTensor, Weights};
