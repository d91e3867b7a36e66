//! The report as Markdown, CSV or JSON.

use super::reference::Match;
use pictures::bands::channel::{Channel, DenseInterval};
use pictures::bands::source::Source;
use serde::Serialize;
use std::fmt::Write;

/// The report on all inputs.
#[derive(Serialize)]
pub struct Report {
    /// Reason why the values are not reflectances. `None` for reflectances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
    /// Thresholds of the shares above.
    pub thresholds: Vec<f64>,
    /// One report per input.
    pub inputs: Vec<InputReport>,
}

/// The report on one input.
#[derive(Serialize)]
pub struct InputReport {
    /// Name of the file or camera.
    pub name: String,
    /// Findings, one sentence each.
    pub diagnosis: Vec<String>,
    /// Channels, sorted by wavelength.
    pub channels: Vec<ChannelReport>,
    /// The reference spectra nearest to the signature, the nearest first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub references: Vec<Match>,
}

/// Statistics of one channel. `None` if it has no valid value.
#[derive(Serialize)]
pub struct ChannelReport {
    /// Center wavelength, nm.
    pub wavelength_nm: f32,
    /// Number of valid values.
    pub n: u64,
    /// Share of invalid pixels, 0 to 1.
    pub invalid: f64,
    /// Smallest, mean, largest value, and standard deviation.
    pub min: Option<f64>,
    #[allow(missing_docs, reason = "see min")]
    pub mean: Option<f64>,
    #[allow(missing_docs, reason = "see min")]
    pub max: Option<f64>,
    #[allow(missing_docs, reason = "see min")]
    pub deviation: Option<f64>,
    /// Share of the values in the densest interval of width 0.1, 0 to 1, and the start of this interval.
    pub densest: [f64; 2],
    /// Share above each threshold, 0 to 1.
    pub above: Vec<f64>,
    /// Mean and standard deviation in the region.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signature: Option<[f64; 2]>,
}

impl InputReport {
    /// The report on one input, with its channels after clipping.
    pub fn new(
        source: &Source,
        channels: &[Channel],
        diagnosis: Vec<String>,
        thresholds: &[f64],
        references: Vec<Match>,
    ) -> Self {
        let channel = |(index, channel): (usize, &Channel)| ChannelReport {
            wavelength_nm: channel.wavelength_nm,
            n: channel.n(),
            invalid: channel.invalid_rate(),
            min: channel.min(),
            mean: channel.mean(),
            max: channel.max(),
            deviation: channel.deviation(),
            densest: {
                let DenseInterval { low, share } = channel.densest(0.1);
                [share, low]
            },
            above: thresholds.iter().map(|threshold| channel.rate_above(*threshold)).collect(),
            signature: source.signature(index),
        };
        let channels = channels.iter().enumerate().map(channel).collect();
        Self { name: source.name.clone(), diagnosis, channels, references }
    }
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.4}"))
}

impl Report {
    /// Markdown tables like tables 4.1 and 4.2 of the thesis.
    pub fn markdown(&self) -> String {
        let mut text = String::new();
        if let Some(warning) = &self.warning {
            let _ = writeln!(text, "**{warning}**\n");
        }
        for input in &self.inputs {
            let _ = writeln!(text, "## {}\n", input.name);
            for finding in &input.diagnosis {
                let _ = writeln!(text, "- {finding}");
            }
            let has_signature = input.channels.iter().any(|channel| channel.signature.is_some());
            let thresholds: Vec<String> = self.thresholds.iter().map(|t| format!(" > {t} |")).collect();
            let thresholds = thresholds.concat();
            let region = if has_signature { " region mean | deviation |" } else { "" };
            let _ = writeln!(text, "\n| Channel | nm | min | mean | max | std | invalid |{thresholds}{region}");
            let n_columns = 7 + self.thresholds.len() + if has_signature { 2 } else { 0 };
            let _ = writeln!(text, "|{}", "---:|".repeat(n_columns));
            for (channel, index) in input.channels.iter().zip(1..) {
                let numbers = [channel.min, channel.mean, channel.max, channel.deviation].map(number).join(" | ");
                let invalid = channel.invalid * 100.0;
                let _ = write!(text, "| {index} | {:.0} | {numbers} | {invalid:.2}% |", channel.wavelength_nm);
                for rate in &channel.above {
                    let _ = write!(text, " {:.2}% |", rate * 100.0);
                }
                if has_signature {
                    let [mean, deviation] = channel.signature.map_or([None; 2], |both| both.map(Some)).map(number);
                    let _ = write!(text, " {mean} | {deviation} |");
                }
                text.push('\n');
            }
            if !input.references.is_empty() {
                let _ = writeln!(text, "\n| Reference | spectral angle |\n|---|---:|");
                for found in &input.references {
                    let _ = writeln!(text, "| {} | {:.2}° |", found.name, found.angle_deg);
                }
            }
            text.push('\n');
        }
        if self.inputs.len() > 1 {
            text.push_str(&self.comparison());
        }
        text
    }

    /// One row per input: means over its channels.
    fn comparison(&self) -> String {
        let thresholds: Vec<String> = self.thresholds.iter().map(|t| format!(" > {t} |")).collect();
        let thresholds = thresholds.concat();
        let mut text =
            format!("## Means over channels\n\n| Input | mean | std | invalid | in the densest 0.1 |{thresholds}\n");
        let _ = writeln!(text, "|---{}|", "|---:".repeat(4 + self.thresholds.len()));
        for input in &self.inputs {
            let mean = |value: &dyn Fn(&ChannelReport) -> Option<f64>| {
                let values: Vec<f64> = input.channels.iter().filter_map(value).collect();
                (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
            };
            let per_cent = |value: &dyn Fn(&ChannelReport) -> f64| {
                format!("{:.1}%", 100.0 * mean(&|channel| Some(value(channel))).unwrap_or_default())
            };
            let center = number(mean(&|channel| channel.mean));
            let width = number(mean(&|channel| channel.deviation));
            let invalid = per_cent(&|channel| channel.invalid);
            let densest = per_cent(&|channel| channel.densest[0]);
            let begin = mean(&|channel| Some(channel.densest[1])).unwrap_or_default();
            let _ = write!(text, "| {} | {center} | {width} | {invalid} | {densest} from {begin:.2} |", input.name);
            for (i, _) in self.thresholds.iter().enumerate() {
                let _ = write!(text, " {} |", per_cent(&|channel| channel.above[i]));
            }
            text.push('\n');
        }
        text + "\n"
    }

    /// CSV with one line per channel of each input. Findings are comment lines.
    pub fn csv(&self) -> String {
        let mut text = String::new();
        if let Some(warning) = &self.warning {
            let _ = writeln!(text, "# {warning}");
        }
        for input in &self.inputs {
            for finding in &input.diagnosis {
                let _ = writeln!(text, "# {}: {finding}", input.name);
            }
        }
        let thresholds: Vec<String> = self.thresholds.iter().map(|t| format!(",above_{t}")).collect();
        let thresholds = thresholds.concat();
        let _ = writeln!(
            text,
            "input,wavelength_nm,n,invalid,min,mean,max,deviation{thresholds},region_mean,region_deviation"
        );
        for input in &self.inputs {
            for channel in &input.channels {
                let name = input.name.replace(['"', '\n'], " ");
                let _ = write!(text, "\"{name}\",{},{},{:.6}", channel.wavelength_nm, channel.n, channel.invalid);
                for value in [channel.min, channel.mean, channel.max, channel.deviation] {
                    let _ = write!(text, ",{}", number(value));
                }
                for rate in &channel.above {
                    let _ = write!(text, ",{rate:.6}");
                }
                let [mean, deviation] = channel.signature.map_or([None; 2], |both| both.map(Some)).map(number);
                let _ = writeln!(text, ",{mean},{deviation}");
            }
        }
        text
    }
}
