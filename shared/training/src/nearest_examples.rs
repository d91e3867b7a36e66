//! Classification by nearest examples in feature space instead of the last layer (thesis section 6.3.2, table 6.3).
//!
//! The network runs without its last layer. The features of each pixel are compared with labeled examples, and the examples with
//! the largest cosine similarity vote. For a pixel a and examples b the largest cosines are the largest a b / |b|: the channels
//! of a 1 x 1 convolution whose filters are the examples. The search is exact except for rounding of these sums.

use crate::{Dataset, Example, TrainingError, UNKNOWN};
use kernels::images::tensors::read_image;
use kernels::images::{Border, Feature, Filter, LANES, Planes, PlanesRef, Shape, convolve};
use random::Random;
use rayon::prelude::*;
use segmentation::network::{Inference, Weights};
use segmentation::spherical::{MAX_CLASSES, PixelClassifier, PolarImage, Settings, Vote};
use std::ops::Range;

/// Examples per filter: their similarities to a row of 512 pixels take 0.5 MB and stay in the second-level cache.
const CHUNK: usize = 256;

/// Number of examples of the data set that go through the network together.
const BATCH: usize = 16;

/// Features of labeled pixels by class.
pub struct NearestExamples {
    k: usize,
    /// Bank of each folded column, because the columns of a pixel share its features.
    banks: Vec<Bank>,
}

impl NearestExamples {
    /// Draws up to `per_class` pixels of a data set for every class and folded column. With the class frequencies of a
    /// street, nearly all neighbors would be road. The `k` nearest examples vote.
    ///
    /// # Errors
    /// If weights or data do not fit the network of the settings, or a class is neither in the settings nor [`UNKNOWN`].
    pub fn draw(
        settings: &Settings,
        weights: &Weights,
        data: &dyn Dataset,
        per_class: usize,
        k: usize,
    ) -> Result<Self, TrainingError> {
        let network = Inference::feature_extractor(settings.network.clone(), weights, Border::Circular)?;
        let mut drawn = vec![Sample::default(); settings.fold * settings.classes.len()];
        let mut random = Random::for_stream(0, 0);
        let indexes: Vec<usize> = (0..data.len()).collect();
        for batch in indexes.chunks(BATCH) {
            let examples: Vec<Example> = batch.par_iter().map(|&index| data.example(index, None)).collect();
            let inputs = examples.iter().map(|example| example.input.to_tensor()).collect::<Result<Vec<_>, _>>()?;
            let results = network.run_batch(&inputs.iter().collect::<Vec<_>>())?;
            for ((features, example), &index) in results.iter().zip(&examples).zip(batch) {
                let truth = &example.truth;
                read_image(features, network.out_channels(), |features| {
                    let size = [features.height(), settings.fold * features.width()];
                    check(truth, index, size, settings.classes.len())?;
                    for (at, &class) in truth.iter().enumerate().filter(|(_, class)| **class != UNKNOWN) {
                        let of_class = &mut drawn[at % settings.fold * settings.classes.len() + usize::from(class)];
                        of_class.offer(|| features_of(&features, at / settings.fold), per_class, &mut random);
                    }
                    Ok::<(), TrainingError>(())
                })??;
            }
        }
        Ok(Self { k, banks: drawn.chunks_exact(settings.classes.len()).map(Bank::new).collect() })
    }

    /// Number of examples of all columns.
    pub fn len(&self) -> usize {
        self.banks.iter().map(|bank| bank.classes.len()).sum()
    }

    /// Whether there are no examples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl PixelClassifier for NearestExamples {
    fn vote(&self, image: &PolarImage, features: &PlanesRef<'_>, votes: &mut [Vote]) {
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

/// Checks that labels fit the size of an image and the number of classes. The image may have more rows, because it is padded.
fn check(truth: &[u8], example: usize, [rows, columns]: [usize; 2], n_classes: usize) -> Result<(), TrainingError> {
    let wrong = |reason| Err(TrainingError::Example { example, reason });
    if truth.len() > rows * columns {
        return wrong(format!("{} pixels have a class, the image has {rows} x {columns}", truth.len()));
    }
    let is_wrong = |&class: &u8| class != UNKNOWN && usize::from(class) >= n_classes;
    truth.iter().position(is_wrong).map_or(Ok(()), |at| {
        let row = at / columns;
        let column = at % columns;
        let class = truth[at];
        wrong(format!(
            "row {row}, column {column} has class {class}, must be below {n_classes}, or {UNKNOWN} if unknown"
        ))
    })
}

/// A uniform sample of a stream (reservoir sampling, algorithm R, Vitter 1985).
#[derive(Clone, Default)]
struct Sample {
    n_seen: usize,
    features: Vec<Vec<f32>>,
}

impl Sample {
    fn offer(&mut self, features: impl FnOnce() -> Vec<f32>, n: usize, random: &mut Random) {
        self.n_seen += 1;
        if self.features.len() < n {
            self.features.push(features());
        } else if let Some(old) = self.features.get_mut(random.index(self.n_seen)) {
            *old = features();
        }
    }
}

/// All channels of a pixel in raster order.
fn features_of(image: &PlanesRef<'_>, pixel: usize) -> Vec<f32> {
    let y = pixel / image.width();
    let x = pixel % image.width();
    (0..image.channels()).map(|channel| image.row(channel / LANES, y)[x][channel % LANES]).collect()
}

/// The vector scaled to length 1; zero stays zero.
fn unit(features: &[f32]) -> impl Iterator<Item = f32> {
    let length = features.iter().map(|v| v * v).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    features.iter().map(move |v| v / length)
}

/// The examples of one folded column.
struct Bank {
    /// One filter per [`CHUNK`] examples.
    filters: Vec<Filter>,
    /// Class of each example.
    classes: Vec<u8>,
    /// Weight of a vote by class: the square root of the number of pixels that an example represents. With equal weights,
    /// rare classes win too often; with the number of pixels, they win too seldom.
    weights: Vec<f32>,
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
    fn new(by_class: &[Sample]) -> Self {
        let features: Vec<&Vec<f32>> = by_class.iter().flat_map(|of_class| &of_class.features).collect();
        let classes = (0..).zip(by_class).flat_map(|(class, of)| std::iter::repeat_n(class, of.features.len()));
        let weight = |of: &Sample| (of.n_seen as f32 / of.features.len().max(1) as f32).sqrt();
        let weights = by_class.iter().map(weight).collect();
        let filter = |examples: &[&Vec<f32>]| {
            let in_channels = vec![examples[0].len()];
            let out_channels = examples.len();
            let shape = Shape { kernel: [1, 1], stride_x: 1, in_channels, out_channels, rectify: false };
            let weights: Vec<f32> = examples.iter().flat_map(|features| unit(features)).collect();
            Filter::new(shape, &weights, &vec![0.0; examples.len()])
        };
        Self { filters: features.chunks(CHUNK).map(filter).collect(), classes: classes.collect(), weights }
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
            sums[class] += self.weights[class];
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

    /// A sample of all features of a class.
    fn class_of(features: Vec<Vec<f32>>) -> Sample {
        Sample { n_seen: features.len(), features }
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
        let bank = Bank::new(&[class_of(examples.clone())]);
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
        let every_other = |features: &[Vec<f32>]| class_of(features.iter().step_by(2).cloned().collect());
        let bank = Bank::new(&[every_other(&adjacent), every_other(&between)]);
        let right = |features: &[Vec<f32>], class: usize| {
            let nearest = bank.nearest(&row_of(features), 3);
            nearest.iter().filter(|near| bank.vote(near)[class] > 127).count()
        };
        // Near the border of a sector, some neighbors are in another sector.
        assert!(right(&between, 1) >= 58 && right(&adjacent, 0) >= 118);
    }

    #[test]
    fn vote_weight_is_root_of_represented_pixels() {
        let rare = class_of(vec![vec![1.0], vec![2.0]]);
        let bank = Bank::new(&[Sample { n_seen: 18, ..rare.clone() }, rare]);
        let vote = bank.vote(&[0, 2, 3].map(|example| Near { likeness: 0.0, example }));
        // One vote with 3 competes with two votes of 1.
        assert_eq!((vote[0], vote[1]), (153, 102));
    }

    #[test]
    fn sample_is_uniform_and_bounded() {
        let mut drawn = Sample::default();
        let mut random = Random::for_stream(5, 0);
        (0..10_000).for_each(|i| drawn.offer(|| vec![i as f32], 500, &mut random));
        let mean = drawn.features.iter().map(|features| features[0]).sum::<f32>() / 500.0;
        // The standard deviation of the mean is 126.
        assert!(drawn.features.len() == 500 && (mean - 5000.0).abs() < 500.0, "{mean}");
    }
}
