//! Data of a training.

use random::Random;
use segmentation::engine::Border;
use training::{Dataset, Example, Hierarchy, UNKNOWN};

/// Data of which some classes have no labels.
pub struct Masked {
    pub data: Box<dyn Dataset>,
    /// Whether the labels of a class are kept.
    pub is_kept: Vec<bool>,
}

impl Dataset for Masked {
    fn len(&self) -> usize {
        self.data.len()
    }
    fn example(&self, index: usize, random: Option<&mut Random>) -> Example {
        let mut example = self.data.example(index, random);
        for class in &mut example.truth {
            if self.is_kept.get(usize::from(*class)) == Some(&false) {
                *class = UNKNOWN;
            }
        }
        example
    }
}

/// Data sets of a training, and how their examples are read.
pub struct Task {
    pub train: Box<dyn Dataset>,
    pub validation: Box<dyn Dataset>,
    /// Names of test scenes and their data.
    pub tests: Vec<(&'static str, Box<dyn Dataset>)>,
    /// Number of classes, and number of columns that are folded into one column of the network.
    pub shape: (usize, usize),
    pub border: Border,
    pub tree: Hierarchy,
}

impl Task {
    /// Checksum (FNV-1a of words) of all examples. Results of other data are not comparable.
    pub fn checksum(&self) -> u64 {
        let sets = [&self.train, &self.validation].into_iter().chain(self.tests.iter().map(|(_, data)| data));
        let mut sum = 0xcbf2_9ce4_8422_2325_u64;
        for example in sets.flat_map(|data| (0..data.len()).map(|index| data.example(index, None))) {
            let values = example.input.values().iter().map(|value| u64::from(value.to_bits()));
            let words = values.chain(example.truth.iter().map(|class| u64::from(*class)));
            sum = words.fold(sum, |sum, word| (sum ^ word).wrapping_mul(0x0100_0000_01b3));
        }
        sum
    }
}
