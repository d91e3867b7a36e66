//! Figures like figures 4.1 to 4.13 of the thesis.

use super::reference;
use super::stretch::Stretch;
use anyhow::Context;
use chart::{Axis, COLORS, Chart, Series};
use formats::envi::LibrarySpectrum;
use pictures::bands::channel::Channel;
use pictures::bands::charts::{
    axis_around, distribution, histogram, histogram_line, histograms, line, nm, wavelengths,
};
use pictures::bands::moments::moments;
use pictures::bands::source::{RegionValues, Source};
use std::path::Path;

/// Largest number of spectra of single cells in one figure: more cannot be distinguished.
const MAX_CELLS: usize = 200;

/// Stretches of figure 4.9 of the thesis.
const STRETCHES: [Stretch; 2] = [Stretch::UpTo(0.2), Stretch::AroundMean(95.0)];

/// The data of the figures.
pub struct Figures<'a> {
    /// All inputs.
    pub sources: &'a [Source],
    /// Their channels after stretching, or unchanged without a stretch.
    pub stretched: &'a [Vec<Channel>],
    /// The stretch that was applied.
    pub stretch: Option<Stretch>,
    /// Reference spectra.
    pub references: &'a [LibrarySpectrum],
    /// Quantity of the values of the inputs.
    pub quantity: &'a str,
}

impl Figures<'_> {
    /// Writes all figures that the inputs have data for.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        let write = |name: &str, chart: &Chart| {
            let path = folder.join(name);
            std::fs::write(&path, chart.svg()).with_context(|| path.display().to_string())
        };
        let quantity = self.stretched_quantity();
        write("histogram.svg", &histogram(self.sources, self.stretched, quantity))?;
        write("distribution.svg", &distribution(self.sources, self.stretched, quantity))?;
        if let Some(stretch) = self.stretch {
            write("expanded.svg", &self.expanded(stretch))?;
        }
        for (number, source) in (1..).zip(self.sources) {
            let Some(region) = &source.region else { continue };
            let path = folder.join(format!("region_{number}.png"));
            region.picture.save(&path).with_context(|| path.display().to_string())?;
            write(&format!("pixels_{number}.svg"), &self.pixels(source, region))?;
        }
        if self.sources.iter().any(|source| source.region.is_some()) {
            write("signature.svg", &self.signature())?;
            write("normalized.svg", &self.normalized())?;
        }
        Ok(())
    }

    /// The quantity of the channels after stretching.
    fn stretched_quantity(&self) -> &str {
        if self.stretch.is_some() { "stretched value (not a reflectance)" } else { self.quantity }
    }

    /// Figures 4.7 and 4.8.
    fn expanded(&self, stretch: Stretch) -> Chart {
        let all = |channels: &[Channel], group: usize, name: &'static str| -> Vec<Series> {
            channels.iter().map(|channel| histogram_line(group, name, channel)).collect()
        };
        let both = self.sources.iter().zip(self.stretched);
        let lines =
            both.flat_map(|(source, after)| [all(&source.channels, 0, "before"), all(after, 1, "after")].concat());
        let title = format!("Histograms by channel before and after they were {}", stretch.description());
        histograms(&title, "reflectance before; stretched value after (not a reflectance)", lines.collect())
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
        lines.extend(
            self.sources
                .first()
                .map(|source| self.nearest_references(source, self.sources.len(), 1))
                .unwrap_or_default(),
        );
        let title = "Signature of the region; bars: standard deviation";
        Chart::new(title, wavelengths(self.sources), axis_around(self.quantity, &lines), lines)
    }

    /// Figures 4.1 and 4.2: the spectra of the cells, and reference spectra.
    fn pixels(&self, source: &Source, region: &RegionValues) -> Chart {
        let n_cells = region.values.first().map_or(0, Vec::len);
        let of_cell = |cell: usize| {
            let values = source.channels.iter().zip(&region.values);
            let points = values.map(|(channel, values)| [nm(channel), f64::from(values[cell])]);
            line(0, &source.name, points.collect())
        };
        let mut lines: Vec<Series> = (0..n_cells).step_by(n_cells.div_ceil(MAX_CELLS).max(1)).map(of_cell).collect();
        lines.extend(self.nearest_references(source, 1, COLORS.len() - 1));
        let y = axis_around(self.quantity, &lines);
        Chart::new("Spectra of the region's cells, and reference spectra", wavelengths(self.sources), y, lines)
    }

    /// Figure 4.9: the mean of the region, unchanged and stretched in both ways.
    fn normalized(&self) -> Chart {
        let mut lines = Vec::new();
        for (source, region) in self.sources.iter().filter_map(|source| Some((source, source.region.as_ref()?))) {
            let group = lines.len();
            let means = (source.channels.iter().enumerate())
                .filter_map(|(index, channel)| Some([nm(channel), source.signature(index)?[0]]));
            lines.push(line(group, &source.name, means.collect()));
            // Arguments replace the threshold and the share of the thesis.
            for stretch in STRETCHES.map(|default| {
                let is_same_kind = |own: &Stretch| std::mem::discriminant(own) == std::mem::discriminant(&default);
                self.stretch.filter(is_same_kind).unwrap_or(default)
            }) {
                let means = source.channels.iter().zip(&region.values).filter_map(|(channel, values)| {
                    Some([nm(channel), moments(stretch.apply(channel, values).values.into_iter())?[0]])
                });
                lines.push(line(lines.len(), &format!("{}, {}", source.name, stretch.description()), means.collect()));
            }
        }
        let y = Axis::new(format!("{}; clipped: stretched value, not a reflectance", self.quantity), [0.0, 1.0]);
        Chart::new("Signature of the region before and after clipping", wavelengths(self.sources), y, lines)
    }

    /// The `n` reference spectra nearest to the region of the input, in colors from `group` on.
    fn nearest_references(&self, source: &Source, group: usize, n: usize) -> Vec<Series> {
        let [low, high] = wavelengths(self.sources).range;
        let nearest = reference::nearest(source, self.references).into_iter().take(n);
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
}
