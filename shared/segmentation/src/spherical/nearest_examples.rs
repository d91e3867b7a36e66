//! Classification by nearest examples in feature space instead of the last layer (thesis section 6.3.2, table 6.3).
//!
//! The network runs without its last layer. The features of each pixel are compared with labeled examples, and the examples with
//! the largest cosine similarity vote. For a pixel a and examples b the largest cosines are the largest a b / |b|: the channels
//! of a 1 x 1 convolution whose filters are the examples. The search is exact except for rounding of these sums.

use super::softmax::{MAX_CLASSES, Vote};
use super::{PolarImage, Settings};
use crate::SegmentationError;
use crate::model_file::ModelFile;
use candle_core::{Device, Tensor};
use kernels::images::{Feature, Filter, LANES, Planes, PlanesRef, Shape, convolve};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;

/// Examples per filter: their similarities to a row of 512 pixels take 0.5 MB and stay in the second-level cache.
const CHUNK: usize = 256;

/// Most examples of a folded column. With 64 features they take 256 MB, and a sweep minutes.
const MOST_EXAMPLES: usize = 1 << 20;

/// Largest number of nearest examples that vote.
pub(super) const MOST_NEAREST: usize = 1000;

/// Settings of a model file with examples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NearestSettings {
    /// Number of nearest examples that vote, 1 to 1000.
    pub k: usize,
}

/// Labeled pixels of one folded column of the images. The columns of a pixel share its features.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColumnExamples {
    /// Features, example by example, each scaled to length 1.
    pub features: Vec<f32>,
    /// Index of the class of each example.
    pub classes: Vec<u8>,
    /// Weight of a vote by class.
    pub vote_weights: Vec<f32>,
}

impl ColumnExamples {
    /// Adds an example. The vector is scaled to length 1; zero stays zero.
    pub fn push(&mut self, features: &[f32], class: u8) {
        let length = features.iter().map(|v| v * v).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
        self.features.extend(features.iter().map(|v| v / length));
        self.classes.push(class);
    }

    /// Reads the examples of a column from a model file.
    fn from_file(
        file: &ModelFile,
        column: usize,
        n_channels: usize,
        n_classes: usize,
    ) -> Result<Self, SegmentationError> {
        let [features, classes, weights] = names_of(column);
        let ids = file.vector(&classes, 1..=MOST_EXAMPLES)?;
        if let Some(at) = ids.iter().position(|id| id.fract() != 0.0 || !(0.0..n_classes as f32).contains(id)) {
            let reason = format!("element {at} is {}, must be a class from 0 to {}", ids[at], n_classes - 1);
            return Err(file.bad_tensor(&classes, reason));
        }
        let vote_weights = file.tensor(&weights, &[n_classes])?;
        if let Some(at) = vote_weights.iter().position(|weight| *weight < 0.0) {
            return Err(
                file.bad_tensor(&weights, format!("element {at} is {}, must not be negative", vote_weights[at]))
            );
        }
        let features = file.tensor(&features, &[ids.len(), n_channels])?;
        Ok(Self { features, classes: ids.iter().map(|id| *id as u8).collect(), vote_weights })
    }

    /// The tensors of the examples in a model file.
    pub(super) fn tensors(&self, column: usize) -> Result<BTreeMap<String, Tensor>, SegmentationError> {
        let [features, classes, weights] = names_of(column);
        let n = self.classes.len();
        let ids: Vec<f32> = self.classes.iter().map(|id| f32::from(*id)).collect();
        Ok(BTreeMap::from([
            (features, Tensor::from_slice(&self.features, (n, self.features.len() / n.max(1)), &Device::Cpu)?),
            (classes, Tensor::from_slice(&ids, n, &Device::Cpu)?),
            (weights, Tensor::from_slice(&self.vote_weights, self.vote_weights.len(), &Device::Cpu)?),
        ]))
    }
}

/// Names of the tensors of a column: features, classes, weights of votes.
fn names_of(column: usize) -> [String; 3] {
    ["features", "classes", "vote_weights"].map(|what| format!("examples.{column}.{what}"))
}

/// Labeled examples that classify pixels.
pub(super) struct NearestExamples {
    k: usize,
    /// Bank of each folded column.
    banks: Vec<Bank>,
}

impl NearestExamples {
    /// The examples of a file.
    pub fn from_file(
        file: &ModelFile,
        settings: &Settings,
        NearestSettings { k }: NearestSettings,
        n_channels: usize,
    ) -> Result<Self, SegmentationError> {
        let read = |column| ColumnExamples::from_file(file, column, n_channels, settings.classes.len());
        let banks = (0..settings.fold).map(|column| Ok(Bank::new(&read(column)?)));
        Ok(Self { k, banks: banks.collect::<Result<_, SegmentationError>>()? })
    }

    /// Writes the votes of the pixels of an image in raster order from its features. Votes of pixels without a point are not written.
    pub fn vote(&self, image: &PolarImage, features: &PlanesRef<'_>, votes: &mut [Vote]) {
        let fold = self.banks.len();
        let mut row = Planes::zeros(features.channels(), 1, features.width());
        let rows = image.pixels.chunks_exact(image.columns).zip(votes.chunks_exact_mut(image.columns));
        for (y, (pixels, votes)) in rows.enumerate() {
            (0..row.n_blocks()).for_each(|block| row.row_mut(block, 0).copy_from_slice(features.row(block, y)));
            for (column, bank) in self.banks.iter().enumerate() {
                let voted = bank.nearest(&row, self.k);
                let of_column = pixels.iter().zip(votes.iter_mut()).skip(column).step_by(fold);
                for ((_, vote), near) in of_column.zip(voted).filter(|((pixel, _), _)| pixel.is_valid()) {
                    *vote = bank.vote(&near);
                }
            }
        }
    }
}

/// The examples of one folded column.
struct Bank {
    /// One filter per [`CHUNK`] examples.
    filters: Vec<Filter>,
    /// Class of each example.
    classes: Vec<u8>,
    vote_weights: Vec<f32>,
}

/// An example that is similar to a pixel.
#[derive(Clone, Copy)]
struct Near {
    /// Cosine similarity, times a factor of the pixel.
    likeness: f32,
    /// Index of the example.
    example: usize,
}

impl Bank {
    fn new(examples: &ColumnExamples) -> Self {
        let ColumnExamples { features, classes, vote_weights } = examples;
        let n_channels = features.len() / classes.len().max(1);
        let filter = |features: &[f32]| {
            let out_channels = features.len() / n_channels;
            let shape =
                Shape { kernel: [1, 1], stride_x: 1, in_channels: vec![n_channels], out_channels, rectify: false };
            Filter::new(shape, features, &vec![0.0; out_channels])
        };
        let filters = features.chunks((CHUNK * n_channels).max(1)).map(filter).collect();
        Self { filters, classes: classes.clone(), vote_weights: vote_weights.clone() }
    }

    /// The `k` nearest examples of every pixel of an image of one row, nearest first; ties are in order of their index.
    fn nearest(&self, row: &Planes, k: usize) -> Vec<Vec<Near>> {
        let mut nearest = vec![Vec::with_capacity(k + 1); row.width()];
        let mut first = 0;
        for filter in &self.filters {
            let n = filter.shape.out_channels;
            let mut likeness = Planes::zeros(n, 1, row.width());
            convolve(filter, &[row], &mut likeness);
            for block in 0..likeness.n_blocks() {
                let examples = first..self.classes.len().min(first + LANES);
                for (likeness, near) in likeness.row(block, 0).iter().zip(&mut nearest) {
                    offer(near, k, likeness, examples.clone());
                }
                first += LANES;
            }
        }
        nearest
    }

    /// The vote of the nearest examples of a pixel.
    fn vote(&self, nearest: &[Near]) -> Vote {
        let mut sums = [0.0; MAX_CLASSES];
        for &Near { example, .. } in nearest {
            let class = usize::from(self.classes[example]);
            sums[class] += self.vote_weights[class];
        }
        let sum: f32 = sums.iter().sum();
        sums.map(|of_class| (255.0 * of_class / sum.max(f32::MIN_POSITIVE)).round() as u8)
    }
}

/// Inserts the examples of a block that are among the `k` nearest so far.
fn offer(nearest: &mut Vec<Near>, k: usize, likeness: &Feature, examples: Range<usize>) {
    for (&value, example) in likeness.iter().zip(examples) {
        let least = if nearest.len() < k { f32::NEG_INFINITY } else { nearest[k - 1].likeness };
        // NaN is not similar to any value.
        if value > least {
            let place = nearest.partition_point(|near| near.likeness >= value);
            nearest.insert(place, Near { likeness: value, example });
            nearest.truncate(k);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use random::Random;

    /// Features of length 2 or 4 with values -1, 0 and 1: all sums of the search are exact, and many are equal.
    fn features(n: usize, n_channels: usize, seed: u64) -> Vec<Vec<f32>> {
        let mut random = Random::for_stream(seed, 0);
        let mut feature = || {
            let mut values = vec![0.0; n_channels];
            let places = random.permutation(n_channels);
            let n_ones = if random.chance(0.5) { 4 } else { 16 };
            places[..n_ones].iter().for_each(|&place| values[place] = if random.chance(0.5) { 1.0 } else { -1.0 });
            values
        };
        (0..n).map(|_| feature()).collect()
    }

    /// A bank of examples whose classes are the indexes of their vectors.
    fn bank_of(classes: &[Vec<Vec<f32>>]) -> Bank {
        let mut examples = ColumnExamples { vote_weights: vec![1.0; classes.len()], ..ColumnExamples::default() };
        for (class, features) in classes.iter().enumerate() {
            for of_example in features {
                examples.push(of_example, class as u8);
            }
        }
        Bank::new(&examples)
    }

    fn row_of(pixels: &[Vec<f32>]) -> Planes {
        let mut row = Planes::zeros(pixels[0].len(), 1, pixels.len());
        for (x, features) in pixels.iter().enumerate() {
            for (channel, value) in features.iter().enumerate() {
                row.row_mut(channel / LANES, 0)[x][channel % LANES] = *value;
            }
        }
        row
    }

    #[test]
    fn search_equals_brute_force() {
        // More examples than fit into a filter, and not a multiple of 16.
        let examples = features(CHUNK + 37, 19, 1);
        let pixels = features(50, 19, 2);
        let bank = bank_of(std::slice::from_ref(&examples));
        for k in [1, 7, 400] {
            let nearest = bank.nearest(&row_of(&pixels), k);
            for (pixel, nearest) in pixels.iter().zip(nearest) {
                // Twice the value: an integer.
                let likeness = |example: &usize| {
                    let features = &examples[*example];
                    let product: f32 = pixel.iter().zip(features).map(|(a, b)| a * b).sum();
                    let square: f32 = features.iter().map(|v| v * v).sum();
                    (4.0 * product / square.sqrt()) as i32
                };
                let mut expected: Vec<usize> = (0..examples.len()).collect();
                expected.sort_by_key(|example| (-likeness(example), *example));
                expected.truncate(k);
                assert_eq!(nearest.iter().map(|near| near.example).collect::<Vec<_>>(), expected);
            }
        }
    }

    #[test]
    fn class_between_two_parts_of_another_is_separated() {
        // Three sectors: a linear classifier cannot separate the middle one from the outer two.
        let sector = |first: usize| -> Vec<Vec<f32>> {
            let at = |i: usize| {
                let angle = (first as f32 + 0.5 * i as f32).to_radians();
                let length = 1.0 + (7 * i % 10) as f32;
                vec![length * angle.cos(), length * angle.sin()]
            };
            (0..60).map(at).collect()
        };
        let between = sector(30);
        let adjacent = [sector(0), sector(60)].concat();
        let every_other = |features: &[Vec<f32>]| -> Vec<Vec<f32>> { features.iter().step_by(2).cloned().collect() };
        let bank = bank_of(&[every_other(&adjacent), every_other(&between)]);
        let right = |features: &[Vec<f32>], class: usize| {
            let nearest = bank.nearest(&row_of(features), 3);
            nearest.iter().filter(|near| bank.vote(near)[class] > 127).count()
        };
        // Near the border of a sector, some neighbors are in another sector.
        assert!(right(&between, 1) >= 58 && right(&adjacent, 0) >= 118);
    }

    #[test]
    fn votes_have_the_weights_of_their_classes() {
        let bank = Bank { vote_weights: vec![3.0, 1.0], ..bank_of(&[vec![vec![1.0]; 2], vec![vec![1.0]; 2]]) };
        let vote = bank.vote(&[0, 2, 3].map(|example| Near { likeness: 0.0, example }));
        // One vote with 3 competes with two votes of 1.
        assert_eq!((vote[0], vote[1]), (153, 102));
    }
}
