//! Statistics of one channel, from any number of images.

/// Start of the histogram. Noise around black is slightly negative.
const LOW: f64 = -0.5;
/// Width of a bin. Results from the histogram alone (percentiles, clipped channels) are exact to half of it.
const BIN: f64 = 0.0005;
/// The histogram ends at 4.5: mirrors reflect more than a white diffuser. The outer bins contain all values beyond.
const N_BINS: usize = 10_000;

/// Statistics of the valid values of one channel.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Center wavelength, nm.
    pub wavelength_nm: f32,
    bins: Vec<u64>,
    n: u64,
    n_invalid: u64,
    sum: f64,
    sum_of_squares: f64,
    min: f64,
    max: f64,
}

/// An interval of values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DenseInterval {
    /// Its lower end.
    pub low: f64,
    /// Share of the values in it.
    pub share: f64,
}

impl Channel {
    /// A channel without values.
    pub fn new(wavelength_nm: f32) -> Self {
        let bins = vec![0; N_BINS];
        let min = f64::INFINITY;
        let max = f64::NEG_INFINITY;
        Self { wavelength_nm, bins, n: 0, n_invalid: 0, sum: 0.0, sum_of_squares: 0.0, min, max }
    }

    /// Adds a valid reflectance.
    pub fn add(&mut self, value: f32) {
        self.add_many(f64::from(value), 1);
    }

    /// Adds a pixel without a valid reflectance.
    pub fn add_invalid(&mut self) {
        self.n_invalid += 1;
    }

    fn add_many(&mut self, value: f64, n: u64) {
        let bin = ((value - LOW) / BIN).floor().clamp(0.0, (N_BINS - 1) as f64) as usize;
        self.bins[bin] += n;
        self.n += n;
        self.sum += value * n as f64;
        self.sum_of_squares += value * value * n as f64;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
    }

    /// Number of valid values.
    pub fn n(&self) -> u64 {
        self.n
    }
    /// Share of invalid pixels, 0 to 1.
    pub fn invalid_rate(&self) -> f64 {
        self.n_invalid as f64 / (self.n + self.n_invalid).max(1) as f64
    }
    /// Smallest value. This and the following are `None` without values.
    pub fn min(&self) -> Option<f64> {
        (self.n > 0).then_some(self.min)
    }
    /// Largest value.
    pub fn max(&self) -> Option<f64> {
        (self.n > 0).then_some(self.max)
    }
    /// Mean.
    pub fn mean(&self) -> Option<f64> {
        (self.n > 0).then(|| self.sum / self.n as f64)
    }
    /// Standard deviation.
    pub fn deviation(&self) -> Option<f64> {
        let mean = self.mean()?;
        Some((self.sum_of_squares / self.n as f64 - mean * mean).max(0.0).sqrt())
    }

    /// Share of the values above a threshold, exact to one bin, 0 to 1.
    pub fn rate_above(&self, threshold: f64) -> f64 {
        self.share(threshold, f64::INFINITY)
    }

    /// Share of the values from `low` to below `high`, exact to one bin.
    pub fn share(&self, low: f64, high: f64) -> f64 {
        let inside = self.filled().filter(|(middle, _)| (low..high).contains(middle)).map(|(_, n)| n).sum::<u64>();
        inside as f64 / self.n.max(1) as f64
    }

    /// The interval of this width with the largest share of the values.
    pub fn densest(&self, width: f64) -> DenseInterval {
        let n_inside = ((width / BIN).round() as usize).clamp(1, N_BINS);
        let mut inside: u64 = self.bins[..n_inside].iter().sum();
        let mut best = inside;
        let mut start = 0;
        for first in 1..=N_BINS - n_inside {
            inside = inside - self.bins[first - 1] + self.bins[first + n_inside - 1];
            if inside > best {
                best = inside;
                start = first;
            }
        }
        DenseInterval { low: LOW + start as f64 * BIN, share: best as f64 / self.n.max(1) as f64 }
    }

    /// Shares of the values in `n` equal intervals from 0 to 1. Values outside are left out.
    pub fn histogram(&self, n: usize) -> Vec<f64> {
        let mut shares = vec![0.0; n];
        for (middle, count) in self.filled().filter(|(middle, _)| (0.0..1.0).contains(middle)) {
            shares[(middle * n as f64) as usize] += count as f64 / self.n.max(1) as f64;
        }
        shares
    }

    /// The interval that contains the `share` (0 to 1) of the values closest to the mean, exact to one bin.
    pub fn around_mean(&self, share: f64) -> [f64; 2] {
        let mean = self.mean().unwrap_or_default();
        let mut by_distance: Vec<(f64, f64, u64)> =
            self.filled().map(|(middle, n)| ((middle - mean).abs(), middle, n)).collect();
        by_distance.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut n = 0;
        let mut low = f64::INFINITY;
        let mut high = f64::NEG_INFINITY;
        for (_, middle, count) in by_distance {
            if n as f64 >= share * self.n as f64 {
                break;
            }
            n += count;
            low = low.min(middle);
            high = high.max(middle);
        }
        [low.max(self.min), high.min(self.max)]
    }

    /// The channel with all values mapped, exact to one bin.
    #[must_use]
    pub fn mapped(&self, change: impl Fn(f64) -> f64) -> Self {
        let mut mapped = Self { n_invalid: self.n_invalid, ..Self::new(self.wavelength_nm) };
        for (middle, n) in self.filled() {
            mapped.add_many(change(middle), n);
        }
        mapped
    }

    /// Centers and counts of the bins that are not empty.
    fn filled(&self) -> impl Iterator<Item = (f64, u64)> {
        let middle = |bin: usize| LOW + (bin as f64 + 0.5) * BIN;
        self.bins.iter().enumerate().filter(|(_, n)| **n > 0).map(move |(bin, n)| (middle(bin), *n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel_of(values: &[f32]) -> Channel {
        let mut channel = Channel::new(500.0);
        for value in values {
            channel.add(*value);
        }
        channel
    }

    #[test]
    fn statistics_match_the_values() {
        let mut channel = channel_of(&[0.1, 0.1, 0.2, 0.8]);
        channel.add_invalid();
        let near = |found: Option<f64>, expected: f64| assert!((found.expect("values") - expected).abs() < 1e-6);
        near(channel.mean(), 0.3);
        near(channel.deviation(), 0.085_f64.sqrt());
        near(channel.min(), 0.1);
        near(channel.max(), 0.8);
        assert_eq!((channel.rate_above(0.05), channel.rate_above(0.15), channel.rate_above(0.9)), (1.0, 0.5, 0.0));
        assert_eq!((channel.invalid_rate(), channel.densest(0.11).share), (0.2, 0.75));
        assert_eq!(channel.histogram(10), [0.0, 0.5, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25, 0.0]);
        assert_eq!(Channel::new(500.0).mean(), None);
    }
}
