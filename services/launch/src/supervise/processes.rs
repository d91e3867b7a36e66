//! The processes of an attempt, in dataflow order.

use super::POLL;
use super::error::SuperviseError;
use crate::active_run::ActiveRun;
use crate::decision::ObservedStage;
use crate::log::LogFormat;
use crate::stage_process::StageProcess;
use ipc::{IpcError, Node};
use run::assignment::Command;
use run::health::Activity;
use run::process::STOP_STAGE;
use rustix::process::Signal;
use std::time::{Duration, Instant};

/// Time between the stop signal and SIGKILL.
const STOP_TIMEOUT: Duration = Duration::from_secs(3);

/// All started processes.
#[derive(Default)]
pub struct Processes {
    /// Processes in the order of the plan.
    pub all: Vec<StageProcess>,
}

impl Processes {
    /// Starts all stages from a barrier.
    pub fn start(
        &mut self,
        run: &ActiveRun,
        node: &Node,
        from: Option<u64>,
        format: LogFormat,
    ) -> Result<(), SuperviseError> {
        for stage in &run.plan.stages {
            let assignment = run.folder.assign(&run.plan, stage, &run.domain, from, None)?;
            self.all.push(StageProcess::start(stage, &assignment, run.folder.log(&stage.name), format, node)?);
        }
        Ok(())
    }

    /// The process of a stage.
    pub fn find(&mut self, stage: &str) -> Option<&mut StageProcess> {
        self.all.iter_mut().find(|process| process.name == stage)
    }

    /// Reads exit statuses and heartbeats.
    pub fn observe(&mut self) {
        self.all.iter_mut().for_each(StageProcess::observe);
    }

    /// The last observations, with times since `origin`.
    pub fn observed(&self, origin: Instant) -> Vec<ObservedStage> {
        self.all.iter().map(|process| process.observed(origin)).collect()
    }

    /// Whether all have connected to their topics.
    pub fn are_ready(&self) -> bool {
        self.all.iter().all(|process| !matches!(process.health.activity, Activity::Starting | Activity::Connecting(_)))
    }

    /// Publishes a command to all running processes.
    pub fn command(&mut self, command: Command) -> Result<(), IpcError> {
        let mut running = self.all.iter_mut().filter(|process| process.status.is_none());
        running.try_for_each(|process| process.command(command))
    }

    /// Asks all to stop, and kills the processes that do not stop in time.
    pub fn stop(&mut self) {
        for process in &self.all {
            process.signal(STOP_STAGE);
        }
        let asked = Instant::now();
        while asked.elapsed() < STOP_TIMEOUT && self.all.iter().any(|process| process.status.is_none()) {
            self.observe();
            std::thread::sleep(POLL);
        }
        self.kill();
    }

    /// Kills all processes. At the same time, because freeing gigabytes of memory takes a process some tenths of a
    /// second.
    pub fn kill(&mut self) {
        for process in &self.all {
            process.signal(Signal::KILL);
        }
        self.all.iter_mut().for_each(StageProcess::kill);
    }
}
