//! Labeled range images, for training and for nearest examples.

use crate::engine::Planes;
use random::Random;

/// Class of a pixel without a label: it is ignored by losses and scores.
pub const UNKNOWN: u8 = u8::MAX;

/// A labeled input of a network.
pub struct Example {
    /// The input. One of its columns holds `fold` columns of the labels.
    pub input: Planes,
    /// Class by row and column, [`UNKNOWN`] without a label; `fold` times as many columns as the input.
    pub truth: Vec<u8>,
}

/// Examples of equal size.
pub trait Dataset: Sync {
    /// Number of examples.
    fn len(&self) -> usize;
    /// Whether there are no examples.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// One example, augmented with the random numbers if given.
    fn example(&self, index: usize, random: Option<&mut Random>) -> Example;
}
