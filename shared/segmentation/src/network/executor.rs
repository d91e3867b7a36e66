//! Interface for running the layers of a network.

use super::layer::Layer;
use crate::SegmentationError;

/// Runs the operations of a network.
pub trait Executor {
    /// Type of the images.
    type Image;
    /// Applies a layer to concatenated sources.
    fn convolution(&mut self, layer: &Layer, sources: &[&Self::Image]) -> Result<Self::Image, SegmentationError>;
    /// The maximum of each window of rows x columns.
    fn max_pool(&mut self, image: &Self::Image, factor: [usize; 2]) -> Result<Self::Image, SegmentationError>;
    /// Repeats every pixel over rows x columns.
    fn upsample(&mut self, image: &Self::Image, factor: [usize; 2]) -> Result<Self::Image, SegmentationError>;
    /// Dropout: in training, sets a share of the values to zero and scales the others to keep the mean.
    fn dropout(&mut self, image: Self::Image, rate: f32) -> Result<Self::Image, SegmentationError>;
}
