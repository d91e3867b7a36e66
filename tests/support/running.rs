//! A supervisor and its stages as processes.

use crate::{is_alive, processes_of, wait_for};
use rustix::process::{Pid, Signal, kill_process};
use std::path::{Path, PathBuf};
use std::process::Child;

/// A running supervisor. Killed when dropped.
pub struct Running {
    child: Child,
    folder: PathBuf,
}

impl Running {
    /// The supervisor that was started for the launch file in `folder`.
    pub(crate) fn new(child: Child, folder: &Path) -> Self {
        Self { child, folder: folder.to_owned() }
    }
    /// The supervisor's process.
    pub fn pid(&self) -> Pid {
        Pid::from_child(&self.child)
    }
    /// The process of a stage, as soon as it exists.
    pub fn stage(&self, stage: &str) -> Pid {
        wait_for(&format!("a process of stage {stage}"), || self.find_stage(stage))
    }
    /// The process of a stage if it runs: the child of the supervisor with the stage's assignment.
    pub fn find_stage(&self, stage: &str) -> Option<Pid> {
        let assignment = format!("/run/{stage}.json");
        processes_of(self.child.id()).into_iter().find(|pid| {
            let line = std::fs::read(format!("/proc/{}/cmdline", pid.as_raw_nonzero())).unwrap_or_default();
            String::from_utf8_lossy(&line).trim_end_matches('\0').ends_with(&assignment)
        })
    }
    /// Kills a stage and waits for its next process, which it returns.
    pub fn kill_stage(&self, stage: &str) -> Pid {
        let killed = self.stage(stage);
        kill_process(killed, Signal::KILL).expect("the stage lives");
        wait_for(&format!("another {stage}"), || self.find_stage(stage).filter(|pid| *pid != killed))
    }
    /// Sends a signal to the supervisor.
    pub fn signal(&self, signal: Signal) {
        kill_process(self.pid(), signal).expect("the supervisor lives");
    }
    /// Kills the supervisor and, if `all`, every process that it has started. Does not wait for the end of the stages.
    pub fn kill(mut self, all: bool) {
        let stages = if all { processes_of(self.child.id()) } else { Vec::new() };
        self.child.kill().expect("a child can be killed");
        for stage in stages {
            // It may have died with its supervisor.
            let _ = kill_process(stage, Signal::KILL);
        }
        self.child.wait().expect("waits");
    }
    /// The exit code if it has ended: `Some(None)` if a signal ended it.
    pub fn ended(&mut self) -> Option<Option<i32>> {
        self.child.try_wait().expect("waits").map(|status| status.code())
    }
    /// Waits for the end. Returns the exit code, `None` if a signal ended it.
    pub fn wait(mut self) -> Option<i32> {
        let status = wait_for("the end of the run", || self.child.try_wait().expect("waits"));
        status.code()
    }
    /// Its messages so far.
    pub fn stderr(&self) -> String {
        std::fs::read_to_string(self.folder.join("stderr.txt")).unwrap_or_default()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if !matches!(self.child.try_wait(), Ok(None)) {
            return;
        }
        let stages = processes_of(self.child.id());
        let _ = self.child.kill();
        let _ = self.child.wait();
        // They die with their supervisor.
        wait_for("the end of the stages", || stages.iter().all(|stage| !is_alive(*stage)).then_some(()));
    }
}
