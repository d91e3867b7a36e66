//! `summary.json`: results and costs of a run.

use crate::control::Swapped;
use crate::health::{Health, Latency, ReportedDoubt, Traffic};
use crate::outcome::Outcome;
use files::atomic_file::write_atomic;
use files::regular_file;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The files of the report that `replica report` writes into the output of a run: the page and its facts.
pub const REPORT_FILES: [&str; 2] = ["report.html", "report.json"];

/// The whole file.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Summary {
    /// How the run ended.
    pub outcome: Outcome,
    /// Faults during the run, in order.
    pub faults: Vec<String>,
    /// Swaps during the run, in order.
    pub swaps: Vec<Swapped>,
    /// End-to-end figures.
    pub total: Total,
    /// Figures by stage, in the order of the dataflow.
    pub stages: Vec<StageSummary>,
}

/// A summary that cannot be written or read.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}", path.display())]
pub struct SummaryError {
    /// The file.
    pub path: PathBuf,
    /// Cause.
    #[source]
    pub cause: std::io::Error,
}

/// End-to-end figures.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Total {
    /// Drive time that was processed, s.
    pub drive_s: f64,
    /// Time from the start of the sources to the end, restarts included, s.
    pub wall_s: f64,
    /// `drive_s / wall_s`.
    pub times_real_time: f64,
    /// Points that reached the sink.
    pub points: u64,
    /// Points per second of wall time.
    pub points_per_s: f64,
    /// User and system time of all stages, s.
    pub cpu_s: f64,
    /// User and system time of the supervisor from the start of the sources to the end, s.
    pub supervisor_cpu_s: f64,
    /// Largest amount of shared memory seen, bytes.
    pub peak_shared_memory_bytes: u64,
    /// Restarts of the run; live, of its stages.
    pub restarts: u32,
    /// Live: messages by topic that were dropped for newer ones or published while a consumer was down.
    pub dropped: BTreeMap<String, u64>,
    /// Time from the start of a tick at the source to its end at the sink.
    pub latency: Latency,
}

/// One stage.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
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
    /// Time from the publication of a message to its delivery to a step, by input topic.
    pub latencies: BTreeMap<String, Latency>,
    /// Points processed.
    pub points: u64,
    /// Points per second of wall time.
    pub points_per_s: f64,
    /// Ticks per second of wall time.
    pub ticks_per_s: f64,
    /// Duration of steps that had input.
    pub step: Latency,
    /// Time from the start of a tick at the source to its end here.
    pub age: Latency,
    /// User and system time, s, of all its processes in this run.
    pub cpu_s: f64,
    /// The part of `cpu_s` spent on loans, sending, waiting and receiving in the last attempt.
    pub transport_cpu_s: f64,
    /// Largest resident memory, bytes; includes the shared memory that the stage touched.
    pub peak_rss_bytes: u64,
    /// Largest resident memory that no other process shares, bytes.
    #[serde(default)]
    pub peak_private_bytes: u64,
    /// Pages that the stage touched first, or that were not in memory.
    #[serde(default)]
    pub page_faults: u64,
    /// Bytes read and written by calls, of files and sockets.
    #[serde(default)]
    pub read_bytes: u64,
    /// Bytes written; see `read_bytes`.
    #[serde(default)]
    pub written_bytes: u64,
    /// Seconds in which its own thread ran no step, by reason: waiting for input or room at a consumer, saving.
    #[serde(default)]
    pub waits: BTreeMap<String, f64>,
    /// Faults of this stage.
    pub faults: u32,
    /// Named counters.
    pub counters: BTreeMap<String, u64>,
    /// Notes for the operator.
    pub notes: Vec<String>,
    /// Reasons not to rely on its results as they are.
    #[serde(default)]
    pub doubts: Vec<ReportedDoubt>,
}

impl StageSummary {
    /// The summary from the last heartbeat. `cpu_s` and `faults` cover all attempts, the other figures only the last
    /// one.
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
            peak_rss_bytes: health.usage.peak_rss_bytes,
            peak_private_bytes: health.peak_private_bytes,
            page_faults: health.usage.page_faults,
            read_bytes: health.usage.read_bytes,
            written_bytes: health.usage.written_bytes,
            waits: health.waits,
            faults,
            counters: health.counters,
            notes: health.notes,
            doubts: health.doubts,
        }
    }
    /// Bytes of rows received; every consumer of a topic counts.
    pub fn bytes_in(&self) -> u64 {
        self.inputs.values().map(|traffic| traffic.bytes).sum()
    }
    fn processed(&self) -> Processed<'_> {
        let moved = |traffic: &Traffic| [traffic.messages, traffic.rows, traffic.bytes];
        let inputs = self.inputs.iter().map(|(topic, traffic)| (topic.as_str(), moved(traffic))).collect();
        Processed { name: &self.name, points: self.points, inputs }
    }
    /// Nanoseconds of CPU for each point processed.
    pub fn cpu_nanos_per_point(&self) -> f64 {
        if self.points == 0 { 0.0 } else { self.cpu_s * 1e9 / self.points as f64 }
    }
}

/// The data that a stage has processed, without its costs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Processed<'a> {
    /// Its table.
    pub name: &'a str,
    /// Points processed.
    pub points: u64,
    /// Messages, rows and bytes by topic.
    pub inputs: BTreeMap<&'a str, [u64; 3]>,
}

/// Rate per second; 0 if no time has passed.
pub fn rate(n: u64, seconds: f64) -> f64 {
    if seconds > 0.0 { n as f64 / seconds } else { 0.0 }
}

impl Summary {
    /// Path of the summary of a run into `output`.
    pub fn file(output: &Path) -> PathBuf {
        output.join("summary.json")
    }
    /// Writes the file, whole or not at all.
    pub fn write(&self, output: &Path) -> Result<(), SummaryError> {
        let path = Self::file(output);
        let write = || write_atomic(&path, &serde_json::to_vec_pretty(self)?);
        write().map_err(|cause| SummaryError { path: path.clone(), cause })
    }
    /// Reads the file of the run in `output`.
    pub fn load(output: &Path) -> Result<Self, SummaryError> {
        let path = Self::file(output);
        let read = || -> std::io::Result<Self> { Ok(serde_json::from_slice(&regular_file::read(&path)?)?) };
        read().map_err(|cause| SummaryError { path: path.clone(), cause })
    }
    /// The exit code of `replica-launch`, without regard to a recording. A live run is incomplete if a stage failed or
    /// missed a message; any run is doubtful if a stage doubts its results.
    pub fn exit_code(&self, is_live: bool) -> u8 {
        let is_lossy = is_live && (!self.faults.is_empty() || !self.total.dropped.is_empty());
        self.outcome.exit_code(!is_lossy && self.doubts().next().is_none())
    }
    /// All doubts, each with the name of its stage.
    pub fn doubts(&self) -> impl Iterator<Item = (&str, &ReportedDoubt)> {
        self.stages.iter().flat_map(|stage| stage.doubts.iter().map(|doubt| (stage.name.as_str(), doubt)))
    }
    /// Bytes of rows that all consumers together received.
    pub fn bytes_handed_over(&self) -> u64 {
        self.stages.iter().map(StageSummary::bytes_in).sum()
    }
    /// Messages that all consumers together received.
    pub fn messages_handed_over(&self) -> u64 {
        self.stages.iter().flat_map(|stage| stage.inputs.values()).map(|traffic| traffic.messages).sum()
    }
    /// CPU time of loans, sending, waiting and receiving in all stages, s.
    pub fn transport_cpu_s(&self) -> f64 {
        self.stages.iter().map(|stage| stage.transport_cpu_s).sum()
    }
    /// Resident memory of all stages at their peaks, bytes; shared memory counts in each that touched it.
    pub fn peak_rss_bytes(&self) -> u64 {
        self.stages.iter().map(|stage| stage.peak_rss_bytes).sum()
    }
    /// The figures that must be equal in every run of the same launch file.
    pub fn processed(&self) -> Vec<Processed<'_>> {
        self.stages.iter().map(StageSummary::processed).collect()
    }
}
