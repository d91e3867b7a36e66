//! Results and costs of a run: collected over all attempts, written to `summary.json` at its end.

use crate::decision::Fault;
use crate::log::Json;
use crate::plan::Plan;
use crate::stage_process::StageProcess;
use ipc::Domain;
use run::Outcome;
use run::control::Swapped;
use run::health::{Health, ReportedDoubt};
use run::process::usage;
use run::summary::{StageSummary, Summary, Total, rate};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Collected over all attempts.
pub struct Account {
    /// All faults in their order.
    pub faults: Vec<Fault>,
    /// Each stage's last heartbeat of the last attempt.
    pub health: BTreeMap<String, Health>,
    /// Restarts of the run; live, of its stages.
    pub restarts: u32,
    /// CPU time of all ended processes by stage, s.
    cpu_s: BTreeMap<String, f64>,
    begun: Instant,
    /// CPU time of this process at `begun`, s.
    own_cpu_s: f64,
    peak_shared_memory: u64,
}

impl Account {
    /// An empty account.
    pub fn new() -> Self {
        Self {
            faults: Vec::new(),
            health: BTreeMap::new(),
            restarts: 0,
            cpu_s: BTreeMap::new(),
            begun: Instant::now(),
            own_cpu_s: 0.0,
            peak_shared_memory: 0,
        }
    }

    /// Starts the clock: the sources start now.
    pub fn begin(&mut self) {
        self.begun = Instant::now();
        self.own_cpu_s = usage().cpu_s;
    }

    /// Time since the sources started, s.
    pub fn wall_s(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// Keeps the largest use of shared memory.
    pub fn measure_shared_memory(&mut self, domain: &Domain) {
        self.peak_shared_memory = self.peak_shared_memory.max(domain.used_bytes());
    }

    /// Adds the CPU time of a process that has ended.
    pub fn add_cpu_time(&mut self, process: &StageProcess) {
        *self.cpu_s.entry(process.name.clone()).or_default() += process.health.usage.cpu_s;
    }

    /// Adds a process that has ended with its attempt.
    pub fn add_process(&mut self, process: &StageProcess) {
        self.add_cpu_time(process);
        self.health.insert(process.name.clone(), process.health.clone());
    }

    /// The summary of the whole run.
    pub fn summary(&self, plan: &Plan, outcome: Outcome, swaps: Vec<Swapped>, wall_s: f64) -> Summary {
        let stages: Vec<StageSummary> = plan
            .stages
            .iter()
            .map(|stage| {
                let health = self.health.get(&stage.name).cloned().unwrap_or_default();
                let faults = self.faults.iter().filter(|fault| fault.stage == stage.name).count() as u32;
                let cpu_s = self.cpu_s.get(&stage.name).copied().unwrap_or_default();
                StageSummary::new(&stage.name, &stage.program, health, cpu_s, faults, wall_s)
            })
            .collect();
        // The plan is in dataflow order: the sink comes last.
        let sink = plan.stages.last().and_then(|sink| self.health.get(&sink.name));
        let drive_s =
            sink.and_then(|h| Some(h.drive_time?.saturating_sub(h.drive_begin?) as f64 * 1e-9)).unwrap_or_default();
        let total = self.total(&stages, drive_s, wall_s);
        let faults = self.faults.iter().map(ToString::to_string).collect();
        Summary { outcome, faults, swaps, total, stages }
    }

    fn total(&self, stages: &[StageSummary], drive_s: f64, wall_s: f64) -> Total {
        let Some(sink) = stages.last() else { return Total::default() };
        Total {
            drive_s,
            wall_s,
            times_real_time: if wall_s > 0.0 { drive_s / wall_s } else { 0.0 },
            points: sink.points,
            points_per_s: rate(sink.points, wall_s),
            cpu_s: stages.iter().map(|stage| stage.cpu_s).sum(),
            supervisor_cpu_s: usage().cpu_s - self.own_cpu_s,
            peak_shared_memory_bytes: self.peak_shared_memory,
            restarts: self.restarts,
            dropped: dropped(stages),
            latency: sink.age,
        }
    }
}

/// Messages by topic that some consumer did not receive.
fn dropped(stages: &[StageSummary]) -> BTreeMap<String, u64> {
    let mut dropped = BTreeMap::new();
    for (topic, traffic) in stages.iter().flat_map(|stage| &stage.inputs).filter(|(_, traffic)| traffic.dropped > 0) {
        *dropped.entry(topic.clone()).or_default() += traffic.dropped;
    }
    dropped
}

/// The last events of a run.
pub fn log_summary(summary: &Summary, output: &Path) {
    let Summary { outcome, total, .. } = summary;
    tracing::info!(
        kind = "done",
        outcome = outcome.word(),
        total = %Json(total),
        "{outcome}: {:.1} s of drive in {:.1} s ({:.2} times real time), {:.2} M points, {} restarts; see {}",
        total.drive_s,
        total.wall_s,
        total.times_real_time,
        total.points as f64 * 1e-6,
        total.restarts,
        output.join("summary.json").display()
    );
    for (stage, doubt) in summary.doubts() {
        let ReportedDoubt { name, size, text } = doubt;
        tracing::warn!(kind = "doubt", stage, doubt = name, size, "[{stage}] doubt: {text}");
    }
    for (topic, n) in &total.dropped {
        tracing::warn!(topic, messages = n, "dropped: {n} messages of {topic}");
    }
}
