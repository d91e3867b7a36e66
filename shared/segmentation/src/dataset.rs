//! Labeled inputs of networks, for training and for nearest examples.

use crate::engine::Planes;
use random::Random;

/// Class of a pixel or point without a label: it is ignored by losses and scores.
pub const UNKNOWN: u8 = u8::MAX;

/// A labeled input of a network on images.
pub struct Example {
    /// The input. One of its columns holds `fold` columns of the labels.
    pub input: Planes,
    /// Class by row and column, [`UNKNOWN`] without a label; `fold` times as many columns as the input.
    pub truth: Vec<u8>,
}

/// A labeled input of a network on points.
pub struct PointExample {
    /// Positions relative to the center of a sphere, m.
    pub positions: Vec<[f32; 3]>,
    /// Features, one point after the other.
    pub features: Vec<f32>,
    /// Class by point, [`UNKNOWN`] without a label.
    pub truth: Vec<u8>,
}

/// Examples: images of equal size, or spheres of points.
pub trait Dataset<E = Example>: Sync {
    /// Number of examples.
    fn len(&self) -> usize;
    /// Whether there are no examples.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// One example, augmented with the random numbers if given.
    fn example(&self, index: usize, random: Option<&mut Random>) -> E;
}
