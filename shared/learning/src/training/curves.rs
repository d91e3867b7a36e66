//! Learning curves.

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

/// Name, color, value, and the value at the top.
type Curve = (&'static str, &'static str, fn(&Epoch) -> f64, f64);

/// Picture, px.
const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 360.0;
const MARGIN: f64 = 50.0;

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
    /// A picture: losses on the left axis, mean IoU and accuracy on the right one.
    pub fn svg(&self) -> String {
        let losses = self.epochs.iter().flat_map(|e| [e.loss, e.validation_loss]);
        let top = losses.filter(|v| v.is_finite()).fold(f64::MIN_POSITIVE, f64::max);
        let last = self.epochs.len().saturating_sub(1).max(1) as f64;
        let (right, bottom) = (WIDTH - MARGIN, HEIGHT - MARGIN);
        let x = |i: usize| MARGIN + (right - MARGIN) * i as f64 / last;
        let y = |share: f64| bottom - (bottom - MARGIN) * share.clamp(0.0, 1.0);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" font-family=\"sans-serif\" font-size=\"12\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
        );
        for tick in 0..=4 {
            let share = f64::from(tick) / 4.0;
            let at = y(share);
            let _ = writeln!(
                svg,
                "<line x1=\"{MARGIN}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\" stroke=\"#ddd\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{:.2}</text><text x=\"{}\" y=\"{:.1}\">{:.0} %</text>",
                MARGIN - 6.0,
                at + 4.0,
                share * top,
                right + 6.0,
                at + 4.0,
                share * 100.0
            );
        }
        let curves: [Curve; 4] = [
            ("loss", "#1f77b4", |e| e.loss, top),
            ("validation loss", "#ff7f0e", |e| e.validation_loss, top),
            ("mIoU", "#2ca02c", |e| e.mean_iou, 1.0),
            ("accuracy", "#9467bd", |e| e.accuracy, 1.0),
        ];
        for (k, (name, color, value, scale)) in curves.into_iter().enumerate() {
            let mut points = String::new();
            for (i, epoch) in self.epochs.iter().enumerate() {
                let _ = write!(points, "{:.1},{:.1} ", x(i), y(value(epoch) / scale));
            }
            let at = MARGIN + 150.0 * k as f64;
            let _ = writeln!(
                svg,
                "<polyline points=\"{points}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>\
                 <text x=\"{at}\" y=\"24\" fill=\"{color}\">{name}</text>"
            );
        }
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">epoch, 0 to {}</text>\n</svg>",
            WIDTH / 2.0,
            HEIGHT - 15.0,
            self.epochs.len().saturating_sub(1)
        );
        svg
    }
}
