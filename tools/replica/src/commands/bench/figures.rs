//! What several runs come to.

use serde::Serialize;
use stage::summary::Summary;
use std::fmt;

/// How messages travel: a value of `run.transport`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Transport {
    /// By reference.
    Shared,
    /// By copy.
    Copying,
}

/// One way to run the pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Configuration {
    /// Cores that all processes of the run share.
    pub cores: usize,
    /// See [`Transport`].
    pub transport: Transport,
}

impl fmt::Display for Configuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let transport = match self.transport {
            Transport::Shared => "shared",
            Transport::Copying => "copying",
        };
        write!(f, "{transport}, {} core{}", self.cores, if self.cores == 1 { "" } else { "s" })
    }
}

/// All runs of one configuration.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// How they ran.
    pub configuration: Configuration,
    /// In the order in which they ran.
    pub runs: Vec<Summary>,
}

/// Median and extremes of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The middle one; of an even number the upper of the two.
    pub median: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

impl Series {
    /// Without runs yet.
    pub fn of(configuration: Configuration) -> Self {
        Self { configuration, runs: Vec::new() }
    }
    /// A figure over all runs.
    pub fn spread(&self, figure: impl Fn(&Summary) -> f64) -> Spread {
        let mut values: Vec<f64> = self.runs.iter().map(figure).collect();
        values.sort_unstable_by(f64::total_cmp);
        let at = |index: usize| values.get(index).copied().unwrap_or_default();
        Spread { median: at(values.len() / 2), min: at(0), max: at(values.len().saturating_sub(1)) }
    }
    /// The median of a figure.
    pub fn median(&self, figure: impl Fn(&Summary) -> f64) -> f64 {
        self.spread(figure).median
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stage::summary::Total;

    #[test]
    fn a_spread_is_that_of_the_runs() {
        let run = |cpu_s: f64| Summary { total: Total { cpu_s, ..Total::default() }, ..Summary::default() };
        let mut series = Series::of(Configuration { cores: 2, transport: Transport::Copying });
        assert_eq!(series.median(|run| run.total.cpu_s), 0.0);
        series.runs = [5.0, 1.0, 3.0].map(run).to_vec();
        assert_eq!(series.spread(|run| run.total.cpu_s), Spread { median: 3.0, min: 1.0, max: 5.0 });
        assert_eq!(series.configuration.to_string(), "copying, 2 cores");
    }
}
