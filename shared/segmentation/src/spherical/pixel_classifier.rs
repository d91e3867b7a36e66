//! Classifiers that replace the last layer of a network on images.

use super::{PolarImage, Vote};
use kernels::images::PlanesRef;

/// Classifies pixels from the inputs of the last layer of the network, instead of this layer.
pub trait PixelClassifier: Send + Sync {
    /// Writes the votes of the pixels of an image in raster order from its features. Votes of pixels without a point
    /// are not written.
    fn vote(&self, image: &PolarImage, features: &PlanesRef<'_>, votes: &mut [Vote]);
}
