//! One attempt of a run: the services are made, the processes started, watched, and all ended.

use super::{Ending, LOOK, Supervisor};
use crate::child::StageProcess;
use crate::recorder::Recorder;
use crate::watch::{Fault, first_fault};
use ipc::{IpcError, Keeper, Node};
use rustix::process::Signal;
use stage::assignment::{Command, wake_name};
use stage::health::Activity;
use stage::process::usage;
use std::time::{Duration, Instant};

/// How often it looks while a swap keeps the pipeline waiting.
const LOOK_CLOSELY: Duration = Duration::from_millis(10);
/// How long a lossless observer that has died may hold up its producer.
const CLEAN_EVERY: Duration = Duration::from_secs(1);
/// How many looks until it tells again what it has told: a stage that has just connected waits for it.
const TELL_AGAIN: u64 = 4;
/// How many looks until it counts shared memory again: asking for every file's size costs more than all else together.
const COUNT_AGAIN: u64 = 10;
/// A stage that was asked to stop has this long until it is killed.
const STOP_PATIENCE: Duration = Duration::from_secs(3);

impl Supervisor {
    /// Starts everything, watches it to its end, and leaves no process behind.
    pub(super) fn attempt(&mut self, resume: Option<u64>) -> Result<Ending, String> {
        // Before the services: who finds them and then still the same wiring knows whose they are.
        self.folder.write_wiring(&self.plan.wiring(&self.domain, self.attempts))?;
        let node = self.domain.node("supervisor").map_err(|error| error.to_string())?;
        let _keeper = self.create_services(&node).map_err(|error| error.to_string())?;
        if let Some(recorder) = &mut self.recorder {
            recorder.start(self.attempts)?;
        }
        self.attempts += 1;
        let mut processes: Vec<StageProcess> = Vec::new();
        let ending = self.start(&node, resume, &mut processes).and_then(|()| self.watch(&node, &mut processes));
        // All at once: giving back gigabytes of memory takes a process some tenths of a second.
        for process in &processes {
            process.signal(Signal::KILL);
        }
        for process in &mut processes {
            process.kill();
            *self.cpu_s.entry(process.name.clone()).or_default() += process.health.cpu_s;
            self.health.insert(process.name.clone(), process.health.clone());
        }
        ending
    }

    /// All services of the run. Stages only open them.
    fn create_services(&self, node: &Node) -> Result<Keeper, IpcError> {
        let mut keeper = Keeper::default();
        let stages = &self.plan.stages;
        for stage in stages {
            for topic in &stage.outputs {
                keeper.create_channel(node, &topic.messages)?;
                keeper.create_channel(node, &topic.ticks)?;
            }
            keeper.create_latest(node, &format!("{}.control", stage.name))?;
            keeper.create_latest(node, &format!("{}.health", stage.name))?;
            // Each topic is rung twice, for messages and for ticks, by each consumer or by its producer; and by the one
            // lossless observer that it may have.
            let consumers: usize = stage.outputs.iter().map(|topic| topic.messages.consumers.len()).sum();
            // The supervisor rings too.
            keeper.create_wake(
                node,
                &wake_name(&stage.name),
                2 * (consumers + stage.inputs.len() + stage.outputs.len()) + 1,
            )?;
        }
        Ok(keeper)
    }

    fn start(&mut self, node: &Node, resume: Option<u64>, processes: &mut Vec<StageProcess>) -> Result<(), String> {
        for stage in &self.plan.stages {
            let assignment = self.folder.assign(&self.plan, stage, &self.domain, resume, None)?;
            let (log, format) = (self.folder.log(&stage.name), self.screen.log());
            processes.push(StageProcess::start(stage, &assignment, log, format, node)?);
        }
        Ok(())
    }

    fn watch(&mut self, node: &Node, processes: &mut [StageProcess]) -> Result<Ending, String> {
        let mut command = Command::default();
        let mut newest = 0;
        let mut cleaned = Instant::now();
        let mut told = None;
        let mut look = 0_u64;
        loop {
            let looked = Instant::now();
            // A stage that dies while it connects may leave a heartbeat that cannot be read: its fault, not the run's end.
            let mut unread = None;
            for process in processes.iter_mut() {
                if let Err(error) = process.observe() {
                    unread.get_or_insert(Fault {
                        stage: process.name.clone(),
                        text: error.to_string(),
                        may_restart: true,
                    });
                }
            }
            if look.is_multiple_of(COUNT_AGAIN) {
                self.peak_shared_memory = self.peak_shared_memory.max(self.domain.used_bytes());
            }
            self.screen.show(processes);
            let figures = processes.iter().map(|process| (process.name.as_str(), &process.health));
            if let Some(text) = self.metrics.update(figures, || self.domain.used_bytes(), self.restarts) {
                self.screen.say(&text);
            }
            let figures = processes.iter().map(|process| (process.name.as_str(), &process.health));
            if let Some(text) = self.costs.as_mut().and_then(|costs| costs.update(figures)) {
                self.screen.say(&text);
            }
            if let Some(mut fault) = first_fault(processes, &self.plan.stages, &self.plan.run, looked).or(unread) {
                let process = processes.iter().find(|process| process.name == fault.stage);
                let last_words = process.map(StageProcess::last_words).unwrap_or_default();
                self.means.explain(&mut fault, process.and_then(|process| process.status), &last_words);
                if self.is_live() && !command.drain && self.put_down(&fault, processes) {
                    continue;
                }
                // At once: ending what is left of the attempt takes its time.
                self.report(&fault, &last_words);
                return Ok(Ending::Failed(fault, last_words));
            }
            self.look_at_requests();
            if let Some(ending) = self.advance_swap(processes, &mut command)? {
                return Ok(ending);
            }
            self.raise_again(node, processes)?;
            if processes.iter().all(|process| process.status.is_some() && !process.is_down) {
                return Ok(Ending::Done);
            }
            self.take_signals(&mut command);
            if self.n_signals > 1 {
                stop(processes);
                return Ok(Ending::Stopped);
            }
            let recorded = self.recorder.as_mut().is_none_or(Recorder::is_ready);
            if let Some(words) = self.recorder.as_mut().and_then(Recorder::last_words) {
                self.screen.say(&words);
            }
            if !command.go && recorded && processes.iter().all(is_ready) {
                command.go = true;
                // Later attempts belong to the same run: its clock goes on.
                if self.attempts == 1 {
                    self.screen.begin();
                    self.begun = Instant::now();
                    self.own_cpu_s = usage().cpu_s;
                }
            }
            if told != Some(command) || look.is_multiple_of(TELL_AGAIN) {
                for process in processes.iter_mut().filter(|process| process.status.is_none()) {
                    process.tell(command).map_err(|error| error.to_string())?;
                }
                told = Some(command);
            }
            let complete = processes.iter().map(|process| process.health.barrier).min().unwrap_or_default();
            if complete > newest {
                // The one before stays too: should a file of the newest turn out torn, the run goes on from there.
                self.folder.forget_before(newest);
                newest = complete;
            }
            // Stages that die end the attempt; who looked on and died must not be waited for.
            if cleaned.elapsed() > CLEAN_EVERY {
                // What cannot be cleaned up now can be the next time.
                let _forgotten = node.forget_dead();
                cleaned = Instant::now();
            }
            look += 1;
            std::thread::sleep(if self.is_swapping() { LOOK_CLOSELY } else { LOOK });
        }
    }

    fn take_signals(&mut self, command: &mut Command) {
        self.n_signals += self.signals.pending().count() as u32;
        if self.n_signals > 0 && !command.drain {
            command.drain = true;
            // Before the word to go there is nothing on the way that would have to be finished.
            command.go = true;
            self.screen.say("draining: what is on the way is finished (once more to stop at once)");
        }
    }
}

fn is_ready(process: &StageProcess) -> bool {
    !matches!(process.health.activity, Activity::Starting | Activity::Connecting(_))
}

/// Asks all to stop, and kills those that do not.
fn stop(processes: &mut [StageProcess]) {
    for process in processes.iter() {
        process.signal(Signal::TERM);
    }
    let asked = Instant::now();
    while asked.elapsed() < STOP_PATIENCE && processes.iter().any(|process| process.status.is_none()) {
        for process in processes.iter_mut() {
            // The end of the wait is bounded whether or not a heartbeat can still be read.
            let _ = process.observe();
        }
        std::thread::sleep(LOOK);
    }
    processes.iter_mut().for_each(StageProcess::kill);
}
