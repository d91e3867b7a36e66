//! Tables 5.1 and 5.2: a U-Net of three levels on MNIST digits. A pixel above half of the full value belongs to the digit. In the
//! multiclass table its class is the digit; background is also a class.
//!
//! As in the published code of the thesis 1000 images are for training and 200 for validation. Only the 10 000 test images of MNIST
//! are used: the first for training, others for validation, and 500 others for testing.

use crate::experiment::{Experiment, Results};
use crate::loss_table::{loss, table_of_losses};
use crate::recipe::{Recipe, settings, unet};
use crate::task::{DataSets, Examples, Task};
use anyhow::Context;
use flate2::read::GzDecoder;
use kernels::images::{Border, Planes};
use random::Random;
use std::io::{Error, ErrorKind, Read};
use std::ops::Range;
use std::path::Path;
use training::{Dataset, Example, Hierarchy};

const SIDE: usize = 28;
const LOSSES: [&str; 6] = ["CE", "Jac. 1", "Jac. 1.25", "Jac. 1.5", "Jac. 1.75", "Jac. 2"];
const FILTERS: [usize; 3] = [2, 4, 8];
const BATCHES: [usize; 3] = [1, 10, 50];
const TRAIN: Range<usize> = 0..1000;
const VALIDATION: Range<usize> = 9300..9500;
const TEST: Range<usize> = 9500..10_000;

/// A data set of images of digits.
struct Digits {
    images: Vec<Vec<u8>>,
    digits: Vec<u8>,
    is_binary: bool,
}

impl Dataset for Digits {
    fn len(&self) -> usize {
        self.images.len()
    }
    fn example(&self, index: usize, _: Option<&mut Random>) -> Example {
        let mut input = Planes::zeros(1, SIDE, SIDE);
        for (y, row) in self.images[index].chunks_exact(SIDE).enumerate() {
            for (pixel, value) in input.row_mut(0, y).iter_mut().zip(row) {
                pixel[0] = f32::from(*value) / 255.0;
            }
        }
        let class = if self.is_binary { 1 } else { 1 + self.digits[index] };
        let truth = self.images[index].iter().map(|&value| if value > 127 { class } else { 0 }).collect();
        Example::new(input, truth)
    }
}

/// Unzips a file and removes its header.
fn unzipped(path: &Path, header: usize) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    GzDecoder::new(std::fs::File::open(path)?).read_to_end(&mut bytes)?;
    bytes
        .get(header..)
        .map(<[u8]>::to_vec)
        .ok_or_else(|| Error::new(ErrorKind::UnexpectedEof, "shorter than its header"))
}

/// A table of MNIST: the binary or the multiclass one.
pub struct Mnist {
    pub is_binary: bool,
}

impl Mnist {
    fn n_classes(&self) -> usize {
        if self.is_binary { 2 } else { 11 }
    }
}

impl Experiment for Mnist {
    fn name(&self) -> &'static str {
        if self.is_binary { "mnist-binary" } else { "mnist-multiclass" }
    }
    fn recipes(&self, n_seeds: u64) -> Vec<Recipe> {
        let mut recipes = Vec::new();
        let kinds = FILTERS.into_iter().flat_map(|filters| BATCHES.map(|batch| (filters, batch)));
        for (filters, batch) in kinds {
            for (seed, row) in (0..n_seeds).flat_map(|seed| LOSSES.map(|row| (seed, row))) {
                recipes.push(Recipe {
                    row: row.to_owned(),
                    column: format!("{filters} filters, batch {batch}"),
                    data: format!(
                        "MNIST test images: {TRAIN:?} to learn, {VALIDATION:?} to validate, {TEST:?} to score"
                    ),
                    network: unet(1, self.n_classes(), filters),
                    frozen: Vec::new(),
                    start: None,
                    tree_of: None,
                    settings: settings(batch, 1e-3, loss(row), seed),
                });
            }
        }
        recipes
    }
    fn load(&self, _: &Recipe) -> anyhow::Result<Task> {
        let folder =
            real_data::find("mnist").context("mnist/ is not in the folder of real data\nhint: see tests/real_data")?;
        let pixels = unzipped(&folder.join("t10k-images-idx3-ubyte.gz"), 16)?;
        let labels = unzipped(&folder.join("t10k-labels-idx1-ubyte.gz"), 8)?;
        let digits = |range: Range<usize>| -> anyhow::Result<Box<dyn Dataset>> {
            let images = pixels.chunks_exact(SIDE * SIDE).skip(range.start).take(range.len()).map(<[u8]>::to_vec);
            let digits = labels.get(range).context("mnist/ has less than 10 000 labels")?.to_vec();
            Ok(Box::new(Digits { images: images.collect(), digits, is_binary: self.is_binary }))
        };
        let sets =
            DataSets { train: digits(TRAIN)?, validation: digits(VALIDATION)?, tests: vec![("test", digits(TEST)?)] };
        let examples = Examples::Images { sets, fold: 1, border: Border::Zero };
        Ok(Task { examples, n_classes: self.n_classes(), tree: Hierarchy::new(vec![0; self.n_classes()]) })
    }
    /// Measured for trainings with 2 and 4 filters, estimated for 8 filters.
    fn cpu_seconds(&self, recipe: &Recipe) -> f64 {
        let (epochs_of_two, epochs_of_more) = match recipe.settings.batch {
            1 => (40.0, 25.0),
            10 => (85.0, 50.0),
            _ => (100.0, 100.0),
        };
        let epochs = if recipe.filters() == FILTERS[0] { epochs_of_two } else { epochs_of_more };
        let of_epoch = if self.is_binary { 1.0 } else { 1.6 };
        of_epoch * epochs * if recipe.filters() == 8 { 2.0 } else { 1.0 }
    }
    fn table(&self, results: &Results) -> String {
        table_of_losses(results)
    }
}
