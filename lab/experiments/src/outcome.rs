//! The result of one training.

use crate::recipe::Recipe;
use scores::Confusion;
use serde::{Deserialize, Serialize};

/// The result of a training. It holds no times: a resumed training writes the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// Epochs done.
    pub epochs: usize,
    /// Number of the epoch with the best validation, whose weights are scored; from 1, 0 without training.
    pub best_epoch: usize,
    /// Whether training ended by patience rather than by the limit of epochs.
    pub converged: bool,
    /// Scores on each test scene.
    pub scenes: Vec<Scene>,
}

/// Scores on a test scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    pub name: String,
    /// Mean IoU, 0 to 1, rounded to six decimals.
    pub mean_iou: f64,
    pub overall_accuracy: f64,
    /// Number of pixels by true (rows) and predicted class.
    pub confusion: Vec<Vec<u64>>,
}

impl Scene {
    pub fn new(name: &str, n_classes: usize, confusion: &Confusion) -> Self {
        let rounded = |share: Option<f64>| (share.unwrap_or(0.0) * 1e6).round() / 1e6;
        let row = |truth| (0..n_classes).map(|predicted| confusion.count(truth, predicted)).collect();
        Self {
            name: name.to_owned(),
            mean_iou: rounded(confusion.mean_iou()),
            overall_accuracy: rounded(confusion.overall_accuracy()),
            confusion: (0..n_classes).map(row).collect(),
        }
    }
    pub fn confusion(&self) -> Confusion {
        let mut confusion = Confusion::new(self.confusion.len());
        for (truth, row) in self.confusion.iter().enumerate() {
            for (predicted, &n) in row.iter().enumerate().take(self.confusion.len()) {
                confusion.add_n(truth, predicted, n);
            }
        }
        confusion
    }
}

impl Outcome {
    /// The pixels of all scenes in one matrix.
    pub fn confusion(&self) -> Confusion {
        let mut sum = Confusion::new(self.scenes.first().map_or(0, |scene| scene.confusion.len()));
        for scene in self.scenes.iter().filter(|scene| scene.confusion.len() == self.scenes[0].confusion.len()) {
            sum.merge(&scene.confusion());
        }
        sum
    }
    pub fn mean_iou(&self) -> f64 {
        self.confusion().mean_iou().unwrap_or(0.0)
    }
}

/// A line of the results of a table: a finished training.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    pub training: String,
    /// Checksum of its data.
    pub inputs: u64,
    pub recipe: Recipe,
    pub outcome: Outcome,
}
