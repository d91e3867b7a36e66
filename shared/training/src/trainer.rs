//! The training loop: batches from a data set, Adam, validation, early stopping.

mod checkpoint;
mod evaluation;

pub use evaluation::Evaluation;

use crate::adam::Adam;
use crate::criterion::Criterion;
use crate::curves::{Curves, Epoch};
use crate::image_network::ImageNetwork;
use crate::losses::{Hierarchy, Loss};
use crate::network::{Network, move_to};
use crate::variables::Variables;
use crate::{Dataset, TrainingError};
use kernels::images::Border;
use random::Random;
use rayon::prelude::*;
use segmentation::network::Weights;
use serde::{Deserialize, Serialize};
use std::sync::mpsc::sync_channel;

/// Settings of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainSettings {
    /// Seed of the initial weights, the order of the examples, and augmentation.
    pub seed: u64,
    /// Largest number of epochs.
    pub epochs: usize,
    /// Examples per step.
    pub batch: usize,
    /// Learning rate of Adam. It rises from 0 during the first hundredth of all steps and falls to 0 along half a cosine.
    pub learning_rate: f64,
    /// Decay of the exponential mean of the variables over the steps, at least 0 and below 1. The mean is validated and
    /// kept (Polyak and Juditsky 1992); 0 uses the variables directly.
    #[serde(default)]
    pub average: f64,
    /// Share of the steps after which batch normalization uses its running statistics as constants, as in prediction.
    /// Running statistics never fit batches of a few spheres well. 0 to 1; the default 1 means never. Without batch
    /// normalization it has no effect.
    #[serde(default = "never", skip_serializing_if = "is_never")]
    pub fixed_statistics: f64,
    /// Training ends after this number of epochs without an improved validation.
    pub patience: usize,
    /// The loss function.
    pub loss: Loss,
    /// Whether the loss on the nodes of the class tree of thesis figure 6.11 is added.
    #[serde(default)]
    pub hierarchy: bool,
    /// Number of labeled pixels or points per step that the loss uses, drawn at random; 0 for all.
    #[serde(default)]
    pub pixels: usize,
    /// Weight of the consistency between a sweep and the same sweep with fewer rings and points, 0 (off) to 100: see
    /// [`consistency`](crate::consistency). A step costs up to twice as much. For networks on images.
    #[serde(default, skip_serializing_if = "is_off")]
    pub consistency: f64,
    /// Weight of the loss of an auxiliary head on the bird's-eye view, 0 (off) to 100: see [`BevHead`](crate::BevHead). The head is in
    /// checkpoints, but not in the model file. For U-Nets on a CPU.
    #[serde(default, skip_serializing_if = "is_off")]
    pub bev_head: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde prescribes the signature")]
fn is_off(weight: &f64) -> bool {
    *weight == 0.0
}

/// Largest weight of an additional loss term.
const MAX_WEIGHT: f64 = 100.0;

fn never() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde prescribes the signature")]
fn is_never(share: &f64) -> bool {
    *share >= never()
}

impl TrainSettings {
    /// The first violated rule, or `None`.
    pub fn problem(&self) -> Option<String> {
        let rules = [
            ((1..=100_000).contains(&self.epochs), format!("epochs = {}, must be 1 to 100000", self.epochs)),
            ((1..=1024).contains(&self.batch), format!("batch = {}, must be 1 to 1024", self.batch)),
            (
                self.learning_rate > 0.0 && self.learning_rate <= 1.0,
                format!("learning_rate = {}, must be above 0 and at most 1", self.learning_rate),
            ),
            (self.patience > 0, format!("patience = {}, must be at least 1", self.patience)),
            ((0.0..1.0).contains(&self.average), format!("average = {}, must be at least 0 and below 1", self.average)),
            (
                (0.0..=1.0).contains(&self.fixed_statistics),
                format!("fixed_statistics = {}, must be 0 to 1", self.fixed_statistics),
            ),
            (
                (0.0..=MAX_WEIGHT).contains(&self.consistency),
                format!("consistency = {}, must be 0 to {MAX_WEIGHT}", self.consistency),
            ),
            (
                (0.0..=MAX_WEIGHT).contains(&self.bev_head),
                format!("bev_head = {}, must be 0 to {MAX_WEIGHT}", self.bev_head),
            ),
        ];
        rules.into_iter().find(|(holds, _)| !holds).map(|(_, text)| text)
    }
}

/// Share of all steps during which the learning rate rises.
const WARM_UP: f64 = 0.01;

/// A training in progress.
pub struct Trainer<N = ImageNetwork> {
    settings: TrainSettings,
    criterion: Criterion,
    network: N,
    /// Exponential mean of the values of the network.
    averaged: N,
    adam: Adam,
    curves: Curves,
    best: Weights,
    /// Name prefixes of variables that are not updated.
    frozen: Vec<String>,
}

/// Receives the number of finished batches of an epoch, and the total number.
pub type Progress<'a> = &'a mut dyn FnMut(usize, usize);

impl Trainer {
    /// Starts a training on images with initial variables. One column of the network holds `fold` columns of labels.
    /// `tree` is used with `hierarchy` in the settings.
    ///
    /// # Errors
    /// If candle fails.
    pub fn new(
        settings: TrainSettings,
        variables: Variables,
        n_classes: usize,
        fold: usize,
        border: Border,
        tree: Hierarchy,
    ) -> Result<Self, TrainingError> {
        Self::from_network(settings, ImageNetwork::new(variables, fold, border), n_classes, tree)
    }
}

impl<N: Network> Trainer<N> {
    /// Starts a training of a network. `tree` is used with `hierarchy` in the settings.
    ///
    /// # Errors
    /// If candle fails.
    pub fn from_network(
        settings: TrainSettings,
        network: N,
        n_classes: usize,
        tree: Hierarchy,
    ) -> Result<Self, TrainingError> {
        let tree = settings.hierarchy.then_some(tree);
        let criterion = Criterion::new(settings.loss.clone(), tree, n_classes, settings.pixels)
            .with_terms(settings.consistency, settings.bev_head);
        let best = network.weights()?;
        let averaged = network.copied()?;
        let adam = Adam::new(settings.learning_rate);
        let curves = Curves::default();
        Ok(Self { settings, criterion, network, averaged, adam, curves, best, frozen: Vec::new() })
    }
    /// Freezes the variables whose names have one of these prefixes: `["down."]` freezes the encoder.
    pub fn freeze(&mut self, prefixes: Vec<String>) {
        self.frozen = prefixes;
    }
    /// The learning curves.
    pub fn curves(&self) -> &Curves {
        &self.curves
    }
    /// The weights with the best validation.
    pub fn best(&self) -> &Weights {
        &self.best
    }
    /// A trainer with the best weights instead of the latest ones, for evaluation.
    ///
    /// # Errors
    /// If candle fails.
    pub fn best_trainer(&self) -> Result<Self, TrainingError> {
        self.with_weights(&self.best)
    }
    /// A trainer with other weights, for evaluation.
    ///
    /// # Errors
    /// If candle fails.
    pub fn with_weights(&self, weights: &Weights) -> Result<Self, TrainingError> {
        let network = self.network.with_weights(weights)?;
        let n_classes = self.criterion.n_classes;
        let tree = self.criterion.tree.clone().unwrap_or_else(|| Hierarchy::new(vec![0; n_classes]));
        Self::from_network(self.settings.clone(), network, n_classes, tree)
    }
    /// Whether all epochs are done, or validation has not improved within `patience`.
    pub fn is_done(&self) -> bool {
        let done = self.curves.epochs.len();
        let since_best = self.curves.best().map_or(0, |best| done - 1 - best.epoch);
        done >= self.settings.epochs || since_best >= self.settings.patience
    }
    /// One pass over the training data and one over the validation data.
    ///
    /// # Errors
    /// If the data do not fit the network.
    pub fn epoch(
        &mut self,
        data: &dyn Dataset<N::Example>,
        validation: &dyn Dataset<N::Example>,
        progress: Progress<'_>,
    ) -> Result<(), TrainingError> {
        let epoch = self.curves.epochs.len();
        let order = Random::for_stream(self.settings.seed, 1 + 2 * epoch as u64).permutation(data.len());
        let batches: Vec<&[usize]> = order.chunks(self.settings.batch).collect();
        let seed = self.settings.seed;
        let random = |index: usize| Random::for_stream(seed ^ (epoch as u64) << 32, 2 * index as u64);
        let examples_of = |batch: &[usize]| -> Vec<N::Example> {
            batch.par_iter().map(|&index| data.example(index, Some(&mut random(index)))).collect()
        };
        let mut sum = 0.0;
        prepared(&batches, examples_of, |i, examples| {
            let step = epoch * batches.len() + i;
            let n_steps = self.settings.epochs * batches.len();
            self.adam.rate = self.learning_rate(step, n_steps);
            self.fix_statistics(step, n_steps)?;
            sum += self.step(&examples, Random::for_stream(seed, (epoch * data.len() + i) as u64 | 1 << 63))?;
            progress(i + 1, batches.len());
            Ok(())
        })?;
        let Evaluation { loss: validation_loss, confusion } = self.evaluate(validation)?;
        // Nine decimals: serde_json may change the last digit of longer numbers, and a resumed training must give the same values.
        let rounded = |value: f64| (value * 1e9).round() / 1e9;
        let [validation_loss, mean_iou, accuracy] =
            [validation_loss, confusion.mean_iou().unwrap_or(0.0), confusion.overall_accuracy().unwrap_or(0.0)]
                .map(rounded);
        let is_best = self.curves.best().is_none_or(|best| mean_iou > best.mean_iou);
        let loss = rounded(sum / batches.len().max(1) as f64);
        self.curves.epochs.push(Epoch { loss, validation_loss, mean_iou, accuracy });
        if is_best {
            self.best = self.averaged.weights()?;
        }
        Ok(())
    }
    /// Fixes the statistics at their means over the last steps, if `step` is a step with fixed statistics.
    fn fix_statistics(&mut self, step: usize, n_steps: usize) -> Result<(), TrainingError> {
        let first = (self.settings.fixed_statistics * n_steps as f64).ceil() as usize;
        if step == first {
            for (name, mean) in self.averaged.statistics() {
                self.network.set_statistic(&name, mean)?;
            }
        }
        if step >= first {
            self.network.fix_statistics();
        }
        Ok(())
    }
    fn learning_rate(&self, step: usize, n_steps: usize) -> f64 {
        let share = (step as f64 + 0.5) / n_steps as f64;
        let fall = 0.5 * (1.0 + (std::f64::consts::PI * share).cos());
        self.settings.learning_rate * fall * (share / WARM_UP).min(1.0)
    }
    /// One step of the optimizer. Returns the loss before it.
    fn step(&mut self, examples: &[N::Example], random: Random) -> Result<f64, TrainingError> {
        let Some(derivatives) = self.network.derive(examples, &self.criterion, random)? else { return Ok(0.0) };
        self.adam.step(self.network.variables(), derivatives.gradients, &self.frozen)?;
        // In the first steps the plain mean is used: the initial variables must not dominate.
        let n = self.adam.steps() as f64;
        move_to(&mut self.averaged, &self.network, 1.0 - self.settings.average.min((n - 1.0) / n))?;
        Ok(derivatives.loss)
    }
}

/// Calls `use_it` with the number of each batch and the result of `prepare`. `prepare` runs ahead, so that a GPU does not
/// wait for the CPU.
fn prepared<T: Send>(
    batches: &[&[usize]],
    prepare: impl Fn(&[usize]) -> T + Send,
    mut use_it: impl FnMut(usize, T) -> Result<(), TrainingError>,
) -> Result<(), TrainingError> {
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(1);
        scope.spawn(move || {
            for batch in batches {
                // The receiver is gone if a step has failed.
                if sender.send(prepare(batch)).is_err() {
                    break;
                }
            }
        });
        receiver.iter().enumerate().try_for_each(|(i, examples)| use_it(i, examples))
    })
}
