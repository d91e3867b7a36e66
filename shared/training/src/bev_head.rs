//! An auxiliary head that classifies the bird's-eye view, as in LiDOG (Saltori et al. 2023, "Walking your LiDOG").
//! Features that also determine the classes on a map depend less on the sensor. The head is used only in training.

use crate::criterion::{Criterion, RowDerivatives, known_rows};
use crate::differential::{Differential, InputDerivatives, Recording};
use crate::pixels::Pixels;
use crate::variables::Variables;
use crate::{BevLabels, Example, NO_CELL, TrainingError, UNKNOWN};
use candle_core::Var;
use kernels::images::{Border, Feature, Planes};
use rayon::prelude::*;
use segmentation::SegmentationError;
use segmentation::network::NetworkSpec;
use std::collections::BTreeMap;

/// Channels of the head. The head is small, so that the features of the network itself must carry the information.
const WIDTH: usize = 32;

/// Prefix of the names of its variables.
const PREFIX: &str = "bev_head.";

/// Two 3 x 3 convolutions and a 1 x 1 convolution on the mean features of the pixels in each cell of a grid.
pub struct BevHead {
    variables: Variables,
}

/// Loss of a batch of grids and its derivatives.
pub(crate) struct OfGrids {
    /// Loss, times its weight.
    pub(crate) loss: f64,
    /// Derivatives with respect to the features of each example; `None` without a labeled cell.
    pub(crate) by_features: Vec<Option<Planes>>,
    /// Derivatives with respect to the variables of the head, by name.
    pub(crate) gradients: BTreeMap<String, Vec<f32>>,
}

impl BevHead {
    /// Random variables from a seed for `inputs` features.
    ///
    /// # Errors
    /// If candle fails.
    pub fn random(inputs: usize, n_classes: usize, seed: u64) -> Result<Self, TrainingError> {
        let spec = NetworkSpec::Unet { inputs, outputs: n_classes, widths: vec![WIDTH], head: None };
        Ok(Self { variables: Variables::random(&spec, seed)? })
    }
    pub(crate) fn copied(&self) -> Result<Self, TrainingError> {
        Ok(Self { variables: self.variables.copied()? })
    }
    /// Its variables, by name.
    pub(crate) fn by_name(&self) -> impl Iterator<Item = (String, Var)> {
        self.variables.iter().map(|(name, var)| (format!("{PREFIX}{name}"), var.clone()))
    }
    /// Loss of the cells of a batch and its derivatives, from the runs of the network on its examples; `None` if no cell is labeled.
    pub(crate) fn derive(
        &self,
        batch: &[Example],
        recordings: &[Recording],
        fold: usize,
        criterion: &Criterion,
    ) -> Result<Option<OfGrids>, TrainingError> {
        let has_class = |labels: &BevLabels| labels.truth.iter().any(|class| *class != UNKNOWN);
        let of_example =
            |example: usize| Some((example, batch[example].bev.as_ref().filter(|labels| has_class(labels))?));
        let grids: Vec<(usize, &BevLabels)> = (0..batch.len()).filter_map(of_example).collect();
        if grids.is_empty() {
            return Ok(None);
        }
        let network = Differential::new(self.variables.spec(), &self.variables.weights()?, Border::Zero)?;
        let features = |example: usize| recordings[example].features();
        let run = |&(example, labels): &(usize, &BevLabels)| network.run(grid(features(example), labels, fold), None);
        let runs: Vec<Recording> = grids.par_iter().map(run).collect::<Result<_, SegmentationError>>()?;
        let outputs: Vec<&Planes> = runs.iter().map(Recording::output).collect();
        let cells = Pixels::from_images(&outputs, criterion.n_classes, 1);
        let truth: Vec<u8> = grids.iter().flat_map(|(_, labels)| labels.truth.iter().copied()).collect();
        let known = known_rows(&truth);
        let classes: Vec<u8> = known.iter().map(|&cell| truth[cell as usize]).collect();
        let RowDerivatives { loss, mut by_logits } = criterion.derive_rows(cells.gather(&outputs, &known), &classes)?;
        for by in &mut by_logits {
            *by *= criterion.bev_head as f32;
        }
        let by_outputs = cells.scatter(&by_logits, &known, &outputs);
        let backward = |((run, by_output), &(example, labels)): ((&Recording, Planes), &(usize, &BevLabels))| {
            let InputDerivatives { by_filters, by_input } = network.backward_to_input(run, by_output);
            (by_filters, (example, by_features(&by_input, features(example), labels, fold)))
        };
        let derived = runs.par_iter().zip(by_outputs).zip(&grids).map(backward);
        let (by_filters, of_examples): (Vec<_>, Vec<_>) = derived.collect::<Vec<_>>().into_iter().unzip();
        let mut by_features: Vec<Option<Planes>> = batch.iter().map(|_| None).collect();
        for (example, by) in of_examples {
            by_features[example] = Some(by);
        }
        let gradients = self.variables.gradients(network.per_layer(by_filters))?;
        let gradients = gradients.into_iter().map(|(name, by)| (format!("{PREFIX}{name}"), by)).collect();
        Ok(Some(OfGrids { loss: criterion.bev_head * loss, by_features, gradients }))
    }
}

/// Calls `f` for each pixel in a cell, with the row and column of the network and the cell.
fn each_pixel(labels: &BevLabels, columns: usize, fold: usize, mut f: impl FnMut(usize, usize, usize)) {
    for (row, cells) in labels.cells.chunks_exact(columns * fold).enumerate() {
        for (column, &cell) in cells.iter().enumerate().filter(|(_, cell)| **cell != NO_CELL) {
            f(row, column / fold, cell as usize);
        }
    }
}

/// Reciprocal of the number of pixels in each cell; infinite for empty cells.
fn shares(labels: &BevLabels) -> Vec<f32> {
    let mut counts = vec![0.0_f32; labels.truth.len()];
    labels.cells.iter().filter(|cell| **cell != NO_CELL).for_each(|&cell| counts[cell as usize] += 1.0);
    counts.into_iter().map(f32::recip).collect()
}

/// Mean features of the pixels of each cell, zero for empty cells. A pixel has the features of its folded column.
fn grid(features: &Planes, labels: &BevLabels, fold: usize) -> Planes {
    let side = labels.side;
    let shares = shares(labels);
    let mut grid = Planes::zeros(features.channels(), side, side);
    for block in 0..features.n_blocks() {
        each_pixel(labels, features.width(), fold, |row, column, cell| {
            let sum = &mut grid.row_mut(block, cell / side)[cell % side];
            add(sum, &features.row(block, row)[column], shares[cell]);
        });
    }
    grid
}

/// Derivative with respect to the features, from the derivative with respect to [`grid`].
fn by_features(by_grid: &Planes, features: &Planes, labels: &BevLabels, fold: usize) -> Planes {
    let side = labels.side;
    let shares = shares(labels);
    let mut by = Planes::zeros(features.channels(), features.height(), features.width());
    for block in 0..features.n_blocks() {
        each_pixel(labels, features.width(), fold, |row, column, cell| {
            let sum = &mut by.row_mut(block, row)[column];
            add(sum, &by_grid.row(block, cell / side)[cell % side], shares[cell]);
        });
    }
    by
}

fn add(sum: &mut Feature, values: &Feature, share: f32) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += share * value);
}
