//! Statistics of a set of errors.

/// Statistics of a set of errors, in their unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// Number of values.
    pub n: usize,
    /// Root mean square.
    pub rmse: f64,
    /// Arithmetic mean.
    pub mean: f64,
    /// Median; for an even number of values the mean of the middle two.
    pub median: f64,
    /// 95th percentile, linearly interpolated (as `percentile` of numpy).
    pub p95: f64,
    /// Standard deviation of the set (divided by n).
    pub deviation: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

impl Statistics {
    /// Computes the statistics; `None` without values. The values must be finite.
    pub fn from_values(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        let min = *values.first()?;
        let max = *values.last()?;
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let mean_square = values.iter().map(|value| value * value).sum::<f64>() / n;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n;
        let at = |share: f64| {
            let position = share * (n - 1.0);
            let index = position as usize;
            let rest = position.fract();
            let next = values[(index + 1).min(values.len() - 1)];
            values[index] + (next - values[index]) * rest
        };
        Some(Self {
            n: values.len(),
            rmse: mean_square.sqrt(),
            mean,
            median: at(0.5),
            p95: at(0.95),
            deviation: variance.sqrt(),
            min,
            max,
        })
    }
    /// Converts to another unit: all values are multiplied by `factor`.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self {
            n: self.n,
            rmse: self.rmse * factor,
            mean: self.mean * factor,
            median: self.median * factor,
            p95: self.p95 * factor,
            deviation: self.deviation * factor,
            min: self.min * factor,
            max: self.max * factor,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_five_values_are_exact() {
        let found = Statistics::from_values([4.0, 1.0, 2.0, 3.0, 10.0]).expect("has values");
        assert_eq!((found.n, found.mean, found.median, found.min, found.max), (5, 4.0, 3.0, 1.0, 10.0));
        assert!((found.rmse - 26.0_f64.sqrt()).abs() < 1e-15 && (found.deviation - 10.0_f64.sqrt()).abs() < 1e-15);
        assert!((found.p95 - 8.8).abs() < 1e-12);
        assert_eq!(Statistics::from_values([1.0, 2.0]).expect("has values").times(2.0).median, 3.0);
        assert_eq!(Statistics::from_values([]), None);
    }
}
