//! The runs of one configuration.

use super::configuration::Configuration;
use run::summary::Summary;
use serde::{Deserialize, Serialize};

/// All runs of one configuration.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Series {
    /// The configuration.
    pub configuration: Configuration,
    /// Summaries of the runs, in the order of execution.
    pub runs: Vec<Summary>,
}

/// Median and range of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Median; the mean of the middle two for an even number of runs.
    pub median: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

impl Series {
    /// A series without runs.
    pub fn new(configuration: Configuration) -> Self {
        Self { configuration, runs: Vec::new() }
    }
    /// Median and range of a value over the runs.
    pub fn spread(&self, value: impl Fn(&Summary) -> f64) -> Spread {
        let mut values: Vec<f64> = self.runs.iter().map(value).collect();
        values.sort_unstable_by(f64::total_cmp);
        let at = |index: usize| values.get(index).copied().unwrap_or_default();
        let middle = at(values.len().saturating_sub(1) / 2).midpoint(at(values.len() / 2));
        Spread { median: middle, min: at(0), max: at(values.len().saturating_sub(1)) }
    }
    /// Median of a value over the runs.
    pub fn median(&self, value: impl Fn(&Summary) -> f64) -> f64 {
        self.spread(value).median
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::summary::Total;

    #[test]
    fn spread_has_median_and_range_of_the_runs() {
        let run = |cpu_s: f64| Summary { total: Total { cpu_s, ..Total::default() }, ..Summary::default() };
        let mut series = Series::new(Configuration { cores: 2 });
        assert_eq!(series.median(|run| run.total.cpu_s), 0.0);
        series.runs = [5.0, 1.0, 3.0].map(run).to_vec();
        assert_eq!(series.spread(|run| run.total.cpu_s), Spread { median: 3.0, min: 1.0, max: 5.0 });
        series.runs.push(run(4.0));
        assert_eq!(series.median(|run| run.total.cpu_s), 3.5);
        assert_eq!(series.configuration.to_string(), "2 cores");
    }
}
