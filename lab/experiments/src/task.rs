//! Data of a training.

use kernels::images::Border;
use random::Random;
use training::{Dataset, Example, Hierarchy, PointExample, UNKNOWN};

/// Images on which some classes have no labels.
struct Masked {
    data: Box<dyn Dataset>,
    /// Whether the labels of a class are kept.
    is_kept: Vec<bool>,
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

/// Examples to learn, to validate and to score.
pub struct DataSets<E> {
    pub train: Box<dyn Dataset<E>>,
    pub validation: Box<dyn Dataset<E>>,
    /// Names of test scenes and their data.
    pub tests: Vec<(&'static str, Box<dyn Dataset<E>>)>,
}

/// Examples, and how they are converted.
pub enum Examples {
    /// `fold` columns are folded into one column of the network.
    Images {
        sets: DataSets<Example>,
        fold: usize,
        border: Border,
    },
    Points(DataSets<PointExample>),
}

/// The data and classes of a training.
pub struct Task {
    pub examples: Examples,
    pub n_classes: usize,
    pub tree: Hierarchy,
}

impl Task {
    /// The task with labels of only some classes in its training and validation images.
    pub fn with_labels_of(self, is_kept: &[bool]) -> Self {
        let masked = |data| -> Box<dyn Dataset> { Box::new(Masked { data, is_kept: is_kept.to_vec() }) };
        let examples = match self.examples {
            Examples::Images { sets: DataSets { train, validation, tests }, fold, border } => {
                let sets = DataSets { train: masked(train), validation: masked(validation), tests };
                Examples::Images { sets, fold, border }
            }
            points @ Examples::Points(_) => points,
        };
        Self { examples, ..self }
    }

    /// Checksum (FNV-1a of words) of all examples. Results of other data are not comparable.
    pub fn checksum(&self) -> u64 {
        let classes = |truth: &[u8]| -> Vec<u64> { truth.iter().map(|class| u64::from(*class)).collect() };
        let bits = |values: &[f32]| -> Vec<u64> { values.iter().map(|value| u64::from(value.to_bits())).collect() };
        match &self.examples {
            Examples::Images { sets, .. } => {
                sets.checksum(|example| [bits(example.input.values()), classes(&example.truth)].concat())
            }
            Examples::Points(sets) => sets.checksum(|PointExample { positions, features, truth }| {
                [bits(positions.as_flattened()), bits(features), classes(truth)].concat()
            }),
        }
    }
}

impl<E> DataSets<E> {
    fn checksum(&self, words: impl Fn(&E) -> Vec<u64>) -> u64 {
        let sets = [&self.train, &self.validation].into_iter().chain(self.tests.iter().map(|(_, data)| data));
        let examples = sets.flat_map(|data| (0..data.len()).map(|index| data.example(index, None)));
        let mix = |sum: u64, word: u64| (sum ^ word).wrapping_mul(0x0100_0000_01b3);
        examples.fold(0xcbf2_9ce4_8422_2325, |sum, example| words(&example).into_iter().fold(sum, mix))
    }
}
