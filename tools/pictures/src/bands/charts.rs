//! Charts of the channels of inputs, like figures 4.3 to 4.13 of the thesis.

use super::channel::Channel;
use super::source::Source;
use chart::{Axis, COLORS, Chart, Series};

/// Number of intervals of a histogram.
const N_INTERVALS: usize = 100;

/// Figures 4.3, 4.6, 4.11 and 4.13: a histogram of each channel. `channels` has the drawn channels, one list for each source;
/// `quantity` names their values.
pub fn histogram(sources: &[Source], channels: &[Vec<Channel>], quantity: &str) -> Chart {
    let lines = (0..).zip(sources).zip(channels).flat_map(|((group, source), channels)| {
        channels.iter().map(move |channel| histogram_line(group, &source.name, channel))
    });
    histograms("Histograms, one line for each channel", quantity, lines.collect())
}

/// Figure 4.4: minimum, mean, maximum and standard deviation over the wavelength. Arguments are as for [`histogram`].
pub fn distribution(sources: &[Source], channels: &[Vec<Channel>], quantity: &str) -> Chart {
    let wavelengths = wavelengths(sources);
    let mut lines = Vec::new();
    for ((group, source), channels) in (0..).zip(sources).zip(channels) {
        let values = |value: fn(&Channel) -> Option<f64>| {
            let points = channels.iter().filter_map(|channel| Some([nm(channel), value(channel)?]));
            line(group, &source.name, points.collect())
        };
        lines.extend([values(Channel::min), values(Channel::mean), values(Channel::max)]);
        // The bars of several inputs are drawn next to each other.
        let aside = (wavelengths.range[1] - wavelengths.range[0]) * 0.006 * group as f64;
        let bar = |channel: &Channel| {
            let mean = channel.mean()?;
            let deviation = channel.deviation()?;
            let at = nm(channel) + aside;
            Some(line(group, &source.name, vec![[at, mean - deviation], [at, mean + deviation]]))
        };
        lines.extend(channels.iter().filter_map(bar));
    }
    let y = axis_around(quantity, &lines);
    Chart::new("Minimum, mean and maximum; bars: standard deviation", wavelengths, y, lines)
}

/// An axis over the bands of all inputs, nm, with a margin.
pub fn wavelengths(sources: &[Source]) -> Axis {
    let all = || sources.iter().flat_map(|source| &source.channels).map(nm);
    let [low, high] = [all().fold(f64::INFINITY, f64::min) - 5.0, all().fold(0.0, f64::max) + 5.0];
    Axis::new("wavelength, nm", [low, high])
}

/// Center wavelength of a channel, nm.
pub fn nm(channel: &Channel) -> f64 {
    f64::from(channel.wavelength_nm)
}

/// A line in the color of the input with number `group`.
pub fn line(group: usize, name: &str, points: Vec<[f64; 2]>) -> Series {
    Series::thin_line(name, COLORS[group % COLORS.len()], points)
}

/// The histogram of a channel as a line, % of its values per 0.01.
pub fn histogram_line(group: usize, name: &str, channel: &Channel) -> Series {
    let shares = channel.histogram(N_INTERVALS);
    let middle = |i: usize| (i as f64 + 0.5) / N_INTERVALS as f64;
    line(group, name, shares.iter().enumerate().map(|(i, share)| [middle(i), share * 100.0]).collect())
}

/// A chart of lines made by [`histogram_line`].
pub fn histograms(title: &str, quantity: &str, lines: Vec<Series>) -> Chart {
    let top = lines.iter().flat_map(Series::points).map(|point| point[1]).fold(1.0, f64::max);
    Chart::new(title, Axis::new(quantity, [0.0, 1.0]), Axis::new("% of pixels per 0.01", [0.0, top]), lines)
}

/// An axis from 0, or from the most negative value, to above the largest value.
pub fn axis_around(label: &str, lines: &[Series]) -> Axis {
    let values = || lines.iter().flat_map(Series::points).map(|point| point[1]).filter(|value| value.is_finite());
    Axis::new(label, [values().fold(0.0, f64::min), values().fold(0.1, f64::max) * 1.02])
}
