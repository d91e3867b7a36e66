//! Live mode: the stages that are down, and the restarts of each stage. [`crate::decision::restart`] decides.

use crate::stage_process::StageProcess;
use run::assignment::Restart;
use run::health::Traffic;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Restarts by stage.
#[derive(Default)]
pub struct StageRestarts(BTreeMap<String, StageRestart>);

#[derive(Default)]
struct StageRestart {
    /// Restarts of this run.
    total: u32,
    /// Restarts since the last healthy process.
    restarts: u32,
    begun: Option<Instant>,
    due: Option<Instant>,
    /// The counts that the last process was given. If it ended before its first heartbeat, they are still valid.
    last: Restart,
}

/// The history on which the decision about a faulty stage depends.
#[derive(Default)]
pub struct History {
    /// Restarts since the last healthy process.
    pub restarts: u32,
    /// Running time of the restarted process. `None`: the stage was never restarted.
    pub ran_for: Option<Duration>,
}

impl StageRestarts {
    /// The history of a stage.
    pub fn history(&self, stage: &str) -> History {
        let stage = self.0.get(stage);
        stage.map_or_else(History::default, |stage| History {
            restarts: stage.restarts,
            ran_for: stage.begun.map(|begun| begun.elapsed()),
        })
    }

    /// Schedules the restart of the stage after a pause.
    pub fn schedule(&mut self, stage: &str, delay: Duration, restart: u32) {
        let stage = self.0.entry(stage.to_owned()).or_default();
        stage.due = Some(Instant::now() + delay);
        stage.restarts = restart;
        stage.total += 1;
    }

    /// Whether the stage is down and its pause is over.
    pub fn is_due(&self, stage: &str) -> bool {
        self.0.get(stage).and_then(|stage| stage.due).is_some_and(|due| due <= Instant::now())
    }

    /// Restarts the process now. Returns the counts that the next process continues.
    pub fn begin(&mut self, process: &StageProcess) -> Restart {
        let stage = self.0.entry(process.name.clone()).or_default();
        stage.due = None;
        stage.begun = Some(Instant::now());
        let health = &process.health;
        stage.last = Restart {
            epoch: stage.total,
            ticks: health.ticks.max(stage.last.ticks),
            inputs: newest(&health.inputs, &stage.last.inputs),
            outputs: newest(&health.outputs, &stage.last.outputs),
        };
        stage.last.clone()
    }
}

/// The last known traffic of each topic.
fn newest(now: &BTreeMap<String, Traffic>, before: &BTreeMap<String, Traffic>) -> BTreeMap<String, Traffic> {
    let mut newest = before.clone();
    for (topic, traffic) in now.iter().filter(|(_, traffic)| traffic.messages > 0) {
        newest.insert(topic.clone(), traffic.clone());
    }
    newest
}
