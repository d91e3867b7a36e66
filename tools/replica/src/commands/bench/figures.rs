//! What a run's `summary.json` says, and what several runs come to.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
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

/// The part of `summary.json` that is reported.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Run {
    /// From end to end.
    pub total: Total,
    /// In the order of the dataflow.
    pub stages: Vec<Stage>,
}

/// See `summary.json`; times in s, sizes in bytes.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[allow(missing_docs, reason = "the fields are those of summary.json")]
pub struct Total {
    pub drive_s: f64,
    pub wall_s: f64,
    pub times_real_time: f64,
    pub points: u64,
    pub points_per_s: f64,
    pub cpu_s: f64,
    pub supervisor_cpu_s: f64,
    pub peak_shared_memory_bytes: u64,
    pub restarts: u32,
    pub latency: Latency,
}

/// One stage.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[allow(missing_docs, reason = "the fields are those of summary.json")]
pub struct Stage {
    pub name: String,
    pub points: u64,
    pub points_per_s: f64,
    pub inputs: BTreeMap<String, Traffic>,
    pub outputs: BTreeMap<String, Traffic>,
    pub step: Latency,
    pub age: Latency,
    pub cpu_s: f64,
    pub transport_cpu_s: f64,
    pub peak_rss_bytes: u64,
}

/// What went over a topic.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[allow(missing_docs, reason = "the fields are those of summary.json")]
pub struct Traffic {
    pub messages: u64,
    pub rows: u64,
    pub bytes: u64,
}

/// Durations.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[allow(missing_docs, reason = "the fields are those of summary.json")]
pub struct Latency {
    pub count: u64,
    pub p50_ms: f64,
    pub p99_ms: f64,
    pub max_ms: f64,
}

impl Stage {
    /// Bytes of rows that came in; every consumer of a topic counts.
    pub fn bytes_in(&self) -> u64 {
        self.inputs.values().map(|traffic| traffic.bytes).sum()
    }
    /// Nanoseconds of CPU for each point that passed.
    pub fn cpu_nanos_per_point(&self) -> f64 {
        if self.points == 0 { 0.0 } else { self.cpu_s * 1e9 / self.points as f64 }
    }
}

impl Run {
    /// Bytes of rows that all consumers together were handed.
    pub fn bytes_handed_over(&self) -> u64 {
        self.stages.iter().map(Stage::bytes_in).sum()
    }
    /// Messages that all consumers together were handed.
    pub fn messages_handed_over(&self) -> u64 {
        self.stages.iter().flat_map(|stage| stage.inputs.values()).map(|traffic| traffic.messages).sum()
    }
    /// CPU time of lending, sending, waiting and receiving in all stages, s.
    pub fn transport_cpu_s(&self) -> f64 {
        self.stages.iter().map(|stage| stage.transport_cpu_s).sum()
    }
    /// Resident memory of all stages at their peaks, bytes; shared memory counts in each that touched it.
    pub fn peak_rss_bytes(&self) -> u64 {
        self.stages.iter().map(|stage| stage.peak_rss_bytes).sum()
    }
    /// What must be the same in every run of the same launch file.
    pub fn processed(&self) -> Vec<(&str, u64, &BTreeMap<String, Traffic>)> {
        self.stages.iter().map(|stage| (stage.name.as_str(), stage.points, &stage.inputs)).collect()
    }
}

/// All runs of one configuration.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// How they ran.
    pub configuration: Configuration,
    /// In the order in which they ran.
    pub runs: Vec<Run>,
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
    pub fn spread(&self, figure: impl Fn(&Run) -> f64) -> Spread {
        let mut values: Vec<f64> = self.runs.iter().map(figure).collect();
        values.sort_unstable_by(f64::total_cmp);
        let at = |index: usize| values.get(index).copied().unwrap_or_default();
        Spread { median: at(values.len() / 2), min: at(0), max: at(values.len().saturating_sub(1)) }
    }
    /// The median of a figure.
    pub fn median(&self, figure: impl Fn(&Run) -> f64) -> f64 {
        self.spread(figure).median
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_that_of_the_runs() {
        let run = |cpu_s: f64| -> Run {
            let latency = Latency { count: 0, p50_ms: 0.0, p99_ms: 0.0, max_ms: 0.0 };
            let total = Total {
                drive_s: 1.0,
                wall_s: 1.0,
                times_real_time: 1.0,
                points: 1,
                points_per_s: 1.0,
                cpu_s,
                supervisor_cpu_s: 0.0,
                peak_shared_memory_bytes: 0,
                restarts: 0,
                latency,
            };
            Run { total, stages: Vec::new() }
        };
        let mut series = Series::of(Configuration { cores: 2, transport: Transport::Copying });
        assert_eq!(series.median(|run| run.total.cpu_s), 0.0);
        series.runs = [5.0, 1.0, 3.0].map(run).to_vec();
        assert_eq!(series.spread(|run| run.total.cpu_s), Spread { median: 3.0, min: 1.0, max: 5.0 });
        assert_eq!(series.configuration.to_string(), "copying, 2 cores");
    }
}
