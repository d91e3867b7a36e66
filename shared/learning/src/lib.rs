//! Models that give every point of a submap its class. The only crate that knows candle.
//!
//! [`load`] reads a model file and returns a [`Segmenter`]; what kind of model it is, the file says. A further
//! architecture is a module beside [`ground`] and a line in [`load`].

mod error;
pub mod ground;
mod model_file;
mod segmenter;

pub use error::LearningError;
pub use model_file::{MAX_MODEL_BYTES, ModelCard};
pub use segmenter::{Cloud, Report, Segmenter, load};
