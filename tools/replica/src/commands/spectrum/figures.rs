//! Figures like 4.1 to 4.13 of the thesis.

use super::channel::Channel;
use super::clip::Clip;
use super::input::{Selection, Source, moments};
use super::{matches, reference};
use anyhow::Context;
use chart::{Axis, COLORS, Chart, Series};
use formats::envi::LibrarySpectrum;
use std::path::Path;

/// Intervals of histograms.
const N_INTERVALS: usize = 100;

/// Spectra of single cells in one figure, at most: more are a blot.
const MAX_CELLS: usize = 200;

/// What the thesis pulled its signatures apart by (figure 4.9).
const CLIPS: [Clip; 2] = [Clip::UpTo(0.2), Clip::AroundMean(95.0)];

/// What is drawn.
pub struct Figures<'a> {
    /// All inputs.
    pub sources: &'a [Source],
    /// Their channels after clipping, if there was any.
    pub stretched: &'a [Vec<Channel>],
    /// How they were clipped.
    pub clip: Option<Clip>,
    /// Known spectra.
    pub references: &'a [LibrarySpectrum],
    /// What the values of the inputs are.
    pub quantity: &'a str,
}

impl Figures<'_> {
    /// Writes all that the inputs have something for.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        let write = |name: &str, chart: &Chart| {
            let path = folder.join(name);
            std::fs::write(&path, chart.svg()).with_context(|| path.display().to_string())
        };
        write("histogram.svg", &self.histogram())?;
        write("distribution.svg", &self.distribution())?;
        if let Some(clip) = self.clip {
            write("expanded.svg", &self.expanded(clip))?;
        }
        for (number, source) in (1..).zip(self.sources) {
            let Some(selection) = &source.region else { continue };
            let path = folder.join(format!("region_{number}.png"));
            selection.picture.save(&path).with_context(|| path.display().to_string())?;
            write(&format!("pixels_{number}.svg"), &self.pixels(source, selection))?;
        }
        if self.sources.iter().any(|source| source.region.is_some()) {
            write("signature.svg", &self.signature())?;
            write("normalized.svg", &self.normalized())?;
        }
        Ok(())
    }

    /// What the channels' values are after clipping.
    fn stretched_quantity(&self) -> &str {
        if self.clip.is_some() { "stretched value (no reflectance)" } else { self.quantity }
    }

    /// Figures 4.3, 4.6, 4.11 and 4.13.
    fn histogram(&self) -> Chart {
        let channels = (0..).zip(self.sources).zip(self.stretched);
        let lines = channels.flat_map(|((group, source), channels)| {
            channels.iter().map(move |channel| histogram_line(group, &source.name, channel))
        });
        histograms("Histograms, one line for each channel", self.stretched_quantity(), lines.collect())
    }

    /// Figures 4.7 and 4.8.
    fn expanded(&self, clip: Clip) -> Chart {
        let all = |channels: &[Channel], group: usize, name: &'static str| -> Vec<Series> {
            channels.iter().map(|channel| histogram_line(group, name, channel)).collect()
        };
        let both = self.sources.iter().zip(self.stretched);
        let lines =
            both.flat_map(|(source, after)| [all(&source.channels, 0, "before"), all(after, 1, "after")].concat());
        let title = format!("Histograms by channel before and after they were {}", clip.words());
        histograms(&title, "reflectance before; stretched value after (no reflectance)", lines.collect())
    }

    /// Figure 4.4.
    fn distribution(&self) -> Chart {
        let wavelengths = self.wavelengths();
        let mut lines = Vec::new();
        for ((group, source), channels) in (0..).zip(self.sources).zip(self.stretched) {
            let values = |value: fn(&Channel) -> Option<f64>| {
                let points = channels.iter().filter_map(|channel| Some([nm(channel), value(channel)?]));
                line(group, &source.name, points.collect())
            };
            lines.extend([values(Channel::min), values(Channel::mean), values(Channel::max)]);
            // Bars of several inputs stand beside each other.
            let aside = (wavelengths.range[1] - wavelengths.range[0]) * 0.006 * group as f64;
            let bar = |channel: &Channel| {
                let (mean, deviation, at) = (channel.mean()?, channel.deviation()?, nm(channel) + aside);
                Some(line(group, &source.name, vec![[at, mean - deviation], [at, mean + deviation]]))
            };
            lines.extend(channels.iter().filter_map(bar));
        }
        let y = around(self.stretched_quantity(), &lines);
        Chart::new("Minimum, mean and maximum; bars: standard deviation", wavelengths, y, lines)
    }

    /// Figures 4.5, 4.10 and 4.12.
    fn signature(&self) -> Chart {
        let mut lines = Vec::new();
        for (group, source) in (0..).zip(self.sources) {
            let signature: Vec<(f64, [f64; 2])> = (source.channels.iter().enumerate())
                .filter_map(|(index, channel)| Some((nm(channel), source.signature(index)?)))
                .collect();
            let means = signature.iter().map(|(nm, [mean, _])| [*nm, *mean]);
            lines.push(line(group, &source.name, means.collect()));
            lines.extend(signature.iter().map(|(nm, [mean, deviation])| {
                line(group, &source.name, vec![[*nm, mean - deviation], [*nm, mean + deviation]])
            }));
        }
        lines.extend(self.sources.first().map(|source| self.known(source, self.sources.len(), 1)).unwrap_or_default());
        let title = "Signature of the region; bars: standard deviation";
        Chart::new(title, self.wavelengths(), around(self.quantity, &lines), lines)
    }

    /// Figures 4.1 and 4.2: the spectrum of each cell, and known ones.
    fn pixels(&self, source: &Source, selection: &Selection) -> Chart {
        let n_cells = selection.values.first().map_or(0, Vec::len);
        let of_cell = |cell: usize| {
            let values = source.channels.iter().zip(&selection.values);
            let points = values.map(|(channel, values)| [nm(channel), f64::from(values[cell])]);
            line(0, &source.name, points.collect())
        };
        let mut lines: Vec<Series> = (0..n_cells).step_by(n_cells.div_ceil(MAX_CELLS).max(1)).map(of_cell).collect();
        lines.extend(self.known(source, 1, COLORS.len() - 1));
        let y = around(self.quantity, &lines);
        Chart::new("Spectra of the region's cells, and known ones", self.wavelengths(), y, lines)
    }

    /// Figure 4.9: the region's mean as it is, and pulled apart in both ways.
    fn normalized(&self) -> Chart {
        let mut lines = Vec::new();
        for (source, selection) in self.sources.iter().filter_map(|source| Some((source, source.region.as_ref()?))) {
            let group = lines.len();
            let means = (source.channels.iter().enumerate())
                .filter_map(|(index, channel)| Some([nm(channel), source.signature(index)?[0]]));
            lines.push(line(group, &source.name, means.collect()));
            // The threshold and the share that were asked for take the place of the thesis' own.
            for clip in CLIPS.map(|clip| {
                self.clip.filter(|own| std::mem::discriminant(own) == std::mem::discriminant(&clip)).unwrap_or(clip)
            }) {
                let means = source.channels.iter().zip(&selection.values).filter_map(|(channel, values)| {
                    Some([nm(channel), moments(clip.stretched(channel, values).1.into_iter())?[0]])
                });
                lines.push(line(lines.len(), &format!("{}, {}", source.name, clip.words()), means.collect()));
            }
        }
        let y =
            Axis::new(format!("{}; of what is clipped a stretched value, no reflectance", self.quantity), [0.0, 1.0]);
        Chart::new("Signature of the region before and after clipping", self.wavelengths(), y, lines)
    }

    /// The known spectra that are most like the input's region, `n` at most, in colors from `group` on.
    fn known(&self, source: &Source, group: usize, n: usize) -> Vec<Series> {
        let [low, high] = self.wavelengths().range;
        let nearest = matches(source, self.references).into_iter().take(n);
        let found = nearest.filter_map(|found| self.references.iter().find(|known| known.name == found.name));
        let series = |(group, known): (usize, &LibrarySpectrum)| {
            let at = |nm: u32| Some([f64::from(nm), reference::at(known, nm as f32)?]);
            Series::line(
                known.name.clone(),
                COLORS[group % COLORS.len()],
                (low as u32..=high as u32).filter_map(at).collect(),
            )
        };
        (group..).zip(found).map(series).collect()
    }

    /// The bands of all inputs and a little more.
    fn wavelengths(&self) -> Axis {
        let all = || self.sources.iter().flat_map(|source| &source.channels).map(nm);
        let [low, high] = [all().fold(f64::INFINITY, f64::min) - 5.0, all().fold(0.0, f64::max) + 5.0];
        Axis::new("wavelength, nm", [low, high])
    }
}

fn nm(channel: &Channel) -> f64 {
    f64::from(channel.wavelength_nm)
}

fn line(group: usize, name: &str, points: Vec<[f64; 2]>) -> Series {
    Series::thin_line(name, COLORS[group % COLORS.len()], points)
}

fn histogram_line(group: usize, name: &str, channel: &Channel) -> Series {
    let shares = channel.histogram(N_INTERVALS);
    let middle = |i: usize| (i as f64 + 0.5) / N_INTERVALS as f64;
    line(group, name, shares.iter().enumerate().map(|(i, share)| [middle(i), share * 100.0]).collect())
}

fn histograms(title: &str, quantity: &str, lines: Vec<Series>) -> Chart {
    let top = lines.iter().flat_map(Series::points).map(|point| point[1]).fold(1.0, f64::max);
    Chart::new(title, Axis::new(quantity, [0.0, 1.0]), Axis::new("% of pixels per 0.01", [0.0, top]), lines)
}

/// From 0, or the least value below it, to a little above the largest.
fn around(label: &str, lines: &[Series]) -> Axis {
    let values = || lines.iter().flat_map(Series::points).map(|point| point[1]).filter(|value| value.is_finite());
    Axis::new(label, [values().fold(0.0, f64::min), values().fold(0.1, f64::max) * 1.02])
}
