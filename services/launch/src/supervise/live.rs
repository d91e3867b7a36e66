//! Live mode: a stage that fails is taken out and started anew alone, while the others go on.

use super::{Supervisor, backoff};
use crate::child::StageProcess;
use crate::watch::Fault;
use ipc::Node;
use stage::Mode;
use stage::assignment::Restart;
use stage::health::Traffic;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A process that has lived so long was well: what ends it then is no repetition of what ended the one before.
const WELL_AFTER: Duration = Duration::from_mins(1);

/// Which stages are down, and how often each has been started anew.
#[derive(Default)]
pub(super) struct LiveRestarts {
    stages: BTreeMap<String, StageRestarts>,
}

#[derive(Default)]
struct StageRestarts {
    /// Of this run.
    total: u32,
    /// Since the stage was last well.
    in_a_row: u32,
    begun: Option<Instant>,
    due: Option<Instant>,
    /// What the last process was told: one that is not heard of after a tick has nothing to add.
    last: Restart,
}

impl LiveRestarts {
    /// Takes down that the stage has failed. The pause until it is started anew, or `None` if it has had its restarts.
    pub(super) fn fail(&mut self, fault: &Fault, allowed: u32, first_delay_s: f64) -> Option<Duration> {
        let stage = self.stages.entry(fault.stage.clone()).or_default();
        if stage.begun.is_some_and(|begun| begun.elapsed() > WELL_AFTER) {
            stage.in_a_row = 0;
        }
        if !fault.may_restart || stage.in_a_row >= allowed {
            return None;
        }
        let delay = backoff(first_delay_s, stage.in_a_row);
        stage.due = Some(Instant::now() + delay);
        stage.in_a_row += 1;
        stage.total += 1;
        Some(delay)
    }

    /// Whether the stage is down and its pause is over.
    pub(super) fn is_due(&self, stage: &str) -> bool {
        self.stages.get(stage).and_then(|stage| stage.due).is_some_and(|due| due <= Instant::now())
    }

    /// What the process that is started now must know of the one that it follows.
    pub(super) fn begin(&mut self, process: &StageProcess) -> Restart {
        let stage = self.stages.entry(process.name.clone()).or_default();
        (stage.due, stage.begun) = (None, Some(Instant::now()));
        let health = &process.health;
        let later = |now: &BTreeMap<String, Traffic>, before: &BTreeMap<String, Traffic>| {
            let mut later = before.clone();
            for (topic, traffic) in now.iter().filter(|(_, traffic)| traffic.messages > 0) {
                later.insert(topic.clone(), traffic.clone());
            }
            later
        };
        stage.last = Restart {
            epoch: stage.total,
            ticks: health.ticks.max(stage.last.ticks),
            inputs: later(&health.inputs, &stage.last.inputs),
            outputs: later(&health.outputs, &stage.last.outputs),
        };
        stage.last.clone()
    }
}

impl Supervisor {
    pub(super) fn is_live(&self) -> bool {
        self.plan.context.mode == Mode::Live
    }

    /// Live: takes a failed stage out until its restart is due. `false` if it is to have no further one.
    pub(super) fn put_down(&mut self, fault: &Fault, processes: &mut [StageProcess]) -> bool {
        let run = &self.plan.run;
        let Some(delay) = self.live.fail(fault, run.restarts, run.restart_delay_s) else { return false };
        let Some(process) = processes.iter_mut().find(|process| process.name == fault.stage) else { return false };
        process.kill();
        process.is_down = true;
        let last_words = process.last_words();
        self.report(fault, &last_words);
        self.screen.say(&format!(
            "[{}] is started anew in {:.1} s; the others go on",
            fault.stage,
            delay.as_secs_f64()
        ));
        self.faults.push(fault.clone());
        true
    }

    /// Live: starts the stages anew whose pause is over.
    pub(super) fn raise_again(&mut self, node: &Node, processes: &mut [StageProcess]) -> Result<(), String> {
        for process in processes.iter_mut().filter(|process| process.is_down) {
            let stage = self.plan.stages.iter().find(|stage| stage.name == process.name);
            let Some(stage) = stage.filter(|stage| self.live.is_due(&stage.name)) else { continue };
            // Its ports are free for the one that follows once the dead process is forgotten.
            if !node.forget_dead() {
                continue;
            }
            *self.cpu_s.entry(process.name.clone()).or_default() += process.health.cpu_s;
            self.restarts += 1;
            let (restart, resume) = (self.live.begin(process), self.folder.last_barrier_of(&stage.name));
            let assignment = self.folder.assign(&self.plan, stage, &self.domain, resume, Some(restart))?;
            process.start_again(stage, &assignment, self.screen.log())?;
        }
        Ok(())
    }
}
