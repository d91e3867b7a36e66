//! Examples for models that compare pixels with labeled ones instead of using their last layer
//! ([`ColumnExamples`], thesis section 6.3.2).

use crate::{Dataset, Example, TrainingError, UNKNOWN};
use kernels::images::tensors::read_image;
use kernels::images::{Border, LANES, PlanesRef};
use random::Random;
use rayon::prelude::*;
use segmentation::network::{Inference, Weights};
use segmentation::spherical::{ColumnExamples, Settings};

/// Number of examples of the data set that go through the network together.
const BATCH: usize = 16;

/// Draws up to `per_class` pixels of a data set for every class and folded column of the images. With the class frequencies of a street,
/// nearly all neighbors would be road. The weight of a vote is the square root of the number of pixels that an example represents:
/// with equal weights, rare classes win too often; with the number of pixels, they win too seldom.
///
/// # Errors
/// If weights or data do not fit the network of the settings, or a class is neither in the settings nor [`UNKNOWN`].
pub fn draw_examples(
    settings: &Settings,
    weights: &Weights,
    data: &dyn Dataset,
    per_class: usize,
) -> Result<Vec<ColumnExamples>, TrainingError> {
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
    Ok(drawn.chunks_exact(settings.classes.len()).map(column_of).collect())
}

/// The examples of a folded column.
fn column_of(by_class: &[Sample]) -> ColumnExamples {
    let weight = |of: &Sample| (of.n_seen as f32 / of.features.len().max(1) as f32).sqrt();
    let mut column =
        ColumnExamples { vote_weights: by_class.iter().map(weight).collect(), ..ColumnExamples::default() };
    for (class, sample) in (0..).zip(by_class) {
        for features in &sample.features {
            column.push(features, class);
        }
    }
    column
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vote_weight_is_root_of_represented_pixels() {
        let rare = Sample { n_seen: 2, features: vec![vec![1.0], vec![2.0]] };
        let column = column_of(&[Sample { n_seen: 18, ..rare.clone() }, rare]);
        assert_eq!((column.vote_weights, column.classes), (vec![3.0, 1.0], vec![0, 0, 1, 1]));
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
