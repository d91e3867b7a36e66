//! Learning curves.

use chart::{Axis, COLORS, Chart, Series};
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Measurements of one epoch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Epoch {
    /// Mean training loss over the batches, each before its step.
    pub loss: f64,
    /// Loss on the validation data.
    pub validation_loss: f64,
    /// Mean IoU on the validation data, 0 to 1.
    pub mean_iou: f64,
    /// Share of correct pixels of the validation data, 0 to 1.
    pub accuracy: f64,
}

/// The epoch with the best validation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BestEpoch {
    /// Its index.
    pub epoch: usize,
    /// Its mean IoU on the validation data, 0 to 1.
    pub mean_iou: f64,
}

/// All epochs so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Curves {
    /// The epochs in order.
    pub epochs: Vec<Epoch>,
}

impl Curves {
    /// The epoch with the best validation; the first one if several are equal.
    pub fn best(&self) -> Option<BestEpoch> {
        let epochs = self.epochs.iter().enumerate();
        let epochs = epochs.map(|(epoch, of)| BestEpoch { epoch, mean_iou: of.mean_iou });
        epochs.rev().max_by(|a, b| a.mean_iou.total_cmp(&b.mean_iou))
    }
    /// One line per epoch.
    pub fn csv(&self) -> String {
        let mut text = String::from("epoch,loss,validation_loss,mean_iou,accuracy\n");
        for (i, e) in self.epochs.iter().enumerate() {
            let _ = writeln!(text, "{i},{},{},{},{}", e.loss, e.validation_loss, e.mean_iou, e.accuracy);
        }
        text
    }
    /// An SVG chart of losses, mean IoU and accuracy.
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
