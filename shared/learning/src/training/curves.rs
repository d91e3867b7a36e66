//! Learning curves.

use chart::{Axis, COLORS, Chart, Series};
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// What was measured after one pass over the data.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Epoch {
    /// Mean over the batches, each before its step.
    pub loss: f64,
    /// On the validation set.
    pub validation_loss: f64,
    /// On the validation set, 0 to 1.
    pub mean_iou: f64,
    /// Share of right pixels of the validation set, 0 to 1.
    pub accuracy: f64,
}

/// All passes so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Curves {
    /// In order.
    pub epochs: Vec<Epoch>,
}

impl Curves {
    /// The pass of the best mean IoU in validation, the first of equals, and that IoU.
    pub fn best(&self) -> Option<(usize, f64)> {
        let with_index = self.epochs.iter().map(|epoch| epoch.mean_iou).enumerate();
        with_index.rev().max_by(|a, b| a.1.total_cmp(&b.1))
    }
    /// One line for each pass.
    pub fn csv(&self) -> String {
        let mut text = String::from("epoch,loss,validation_loss,mean_iou,accuracy\n");
        for (i, e) in self.epochs.iter().enumerate() {
            let _ = writeln!(text, "{i},{},{},{},{}", e.loss, e.validation_loss, e.mean_iou, e.accuracy);
        }
        text
    }
    /// A picture: losses, and below them mean IoU and accuracy.
    pub fn svg(&self) -> String {
        let line = |name: &str, color: usize, value: fn(&Epoch) -> f64| {
            let points = self.epochs.iter().enumerate().map(|(i, epoch)| [i as f64, value(epoch)]);
            Series::line(name, COLORS[color], points.collect())
        };
        let last = self.epochs.len().saturating_sub(1).max(1) as f64;
        let epochs = Axis::new("epoch", [0.0, last]);
        let losses = Axis::from_zero("loss", self.epochs.iter().flat_map(|e| [e.loss, e.validation_loss]));
        let upper = vec![line("training", 0, |e| e.loss), line("validation", 1, |e| e.validation_loss)];
        let lower = vec![line("mIoU", 2, |e| 100.0 * e.mean_iou), line("accuracy", 3, |e| 100.0 * e.accuracy)];
        let size = [640.0, 200.0];
        let upper = Chart { size, ..Chart::new("Loss", epochs.clone(), losses, upper) };
        let percent = Axis::new("%", [0.0, 100.0]);
        let lower = Chart { size, ..Chart::new("Validation", epochs, percent, lower) };
        chart::sheet(&[upper, lower], 1)
    }
}
