//! Models that give every point of a submap its class. The only crate that knows candle.
//!
//! [`load`] reads a model file and returns a [`Segmenter`]; what kind of model it is, the file says. A further
//! architecture is a module beside [`ground`] and a line in [`load`].

pub mod engine;
mod error;
pub mod ground;
pub mod losses;
mod model_file;
pub mod network;
mod random;
pub mod scores;
mod segmenter;
pub mod spherical;
pub mod training;

pub use error::LearningError;
pub use model_file::{MAX_MODEL_BYTES, ModelCard};
pub use random::Random;
pub use segmenter::{Cloud, Options, Report, Segmenter, load};
