//! `summary.json`: what a run did and what it cost.

use formats::atomic_file::write_atomic;
use serde::Serialize;
use stage::control::Swapped;
use stage::health::{Health, Latency, Traffic};
use std::collections::BTreeMap;
use std::path::Path;

/// The whole file.
#[derive(Serialize)]
pub struct Summary {
    /// `done`, `drained` (ended early on request), `stopped` or `failed`.
    pub outcome: &'static str,
    /// What went wrong on the way, in order.
    pub faults: Vec<String>,
    /// What was swapped on the way, in order.
    pub swaps: Vec<Swapped>,
    /// From end to end.
    pub total: Total,
    /// By stage, in the order of the dataflow.
    pub stages: Vec<StageSummary>,
}

/// End to end.
#[derive(Default, Serialize)]
pub struct Total {
    /// Drive time that was processed, s.
    pub drive_s: f64,
    /// From the word to go to the end, restarts included, s.
    pub wall_s: f64,
    /// `drive_s / wall_s`.
    pub times_real_time: f64,
    /// Points that reached the sink.
    pub points: u64,
    /// Points per second of wall time.
    pub points_per_s: f64,
    /// User and system time of all stages, s.
    pub cpu_s: f64,
    /// User and system time of the supervisor from the word to go to the end, s.
    pub supervisor_cpu_s: f64,
    /// Largest amount of shared memory seen, bytes.
    pub peak_shared_memory_bytes: u64,
    /// Restarts of the run; live, of its stages.
    pub restarts: u32,
    /// Live: messages by topic that made way for newer ones or came while a consumer was down.
    pub dropped: BTreeMap<String, u64>,
    /// From the source's beginning of a tick to its end at the sink.
    pub latency: Latency,
}

/// One stage.
#[derive(Serialize)]
pub struct StageSummary {
    /// Its table.
    pub name: String,
    /// Its binary.
    pub program: String,
    /// Ticks.
    pub ticks: u64,
    /// Messages, rows and bytes by topic.
    pub inputs: BTreeMap<String, Traffic>,
    /// Messages, rows and bytes by topic.
    pub outputs: BTreeMap<String, Traffic>,
    /// From the publication of a message to its delivery to a step, by input topic.
    pub latencies: BTreeMap<String, Latency>,
    /// Points that passed.
    pub points: u64,
    /// Points per second of wall time.
    pub points_per_s: f64,
    /// Ticks per second of wall time.
    pub ticks_per_s: f64,
    /// Time in a step that had input.
    pub step: Latency,
    /// From the source's beginning of a tick to its end here.
    pub age: Latency,
    /// User and system time, s, of all its processes in this run.
    pub cpu_s: f64,
    /// The part of `cpu_s` that lending, sending, waiting and receiving took in the last attempt.
    pub transport_cpu_s: f64,
    /// Largest resident memory, bytes; shared memory that it touched counts too.
    pub peak_rss_bytes: u64,
    /// Faults that were its own.
    pub faults: u32,
    /// Named counters.
    pub counters: BTreeMap<String, u64>,
    /// What it said.
    pub notes: Vec<String>,
}

impl StageSummary {
    /// From the last heartbeat; `cpu_s` and `faults` are over all attempts, latencies those of the last.
    pub fn new(name: &str, program: &Path, health: Health, cpu_s: f64, faults: u32, wall_s: f64) -> Self {
        Self {
            name: name.to_owned(),
            program: program.display().to_string(),
            ticks: health.ticks,
            inputs: health.inputs,
            outputs: health.outputs,
            latencies: health.arrivals.iter().map(|(topic, arrivals)| (topic.clone(), arrivals.latency)).collect(),
            points: health.points,
            points_per_s: rate(health.points, wall_s),
            ticks_per_s: rate(health.ticks, wall_s),
            step: health.step,
            age: health.age,
            cpu_s,
            transport_cpu_s: health.transport_cpu_s,
            peak_rss_bytes: health.peak_rss_bytes,
            faults,
            counters: health.counters,
            notes: health.notes,
        }
    }
}

/// Per second; 0 if no time has passed.
pub fn rate(n: u64, seconds: f64) -> f64 {
    if seconds > 0.0 { n as f64 / seconds } else { 0.0 }
}

impl Summary {
    /// Writes the file, whole or not at all.
    pub fn write(&self, output: &Path) -> Result<(), String> {
        let path = output.join("summary.json");
        let text = serde_json::to_vec_pretty(self).map_err(|error| error.to_string())?;
        write_atomic(&path, &text).map_err(|error| format!("{}: {error}", path.display()))
    }
}
