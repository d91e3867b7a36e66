//! The life of a run: make the drive, start the stages, watch, restart from the last barrier, sum up.

use crate::child::StageProcess;
use crate::plan::Plan;
use crate::programs;
use crate::run_folder::RunFolder;
use crate::screen::Screen;
use crate::summary::{StageSummary, Summary, Total, rate};
use crate::watch::{Fault, first_fault};
use ipc::{Domain, IpcError, Keeper, Node};
use rustix::process::Signal;
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::iterator::Signals;
use stage::assignment::{Command, wake_name};
use stage::exit;
use stage::health::{Activity, Health};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

/// How often the supervisor looks: a twentieth of a second is soon enough for people and costs 1 % of a core.
const LOOK: Duration = Duration::from_millis(50);
/// A stage that was asked to stop has this long until it is killed.
const STOP_PATIENCE: Duration = Duration::from_secs(3);
/// The longest pause before a restart.
const MAX_DELAY: Duration = Duration::from_secs(30);

/// How an attempt ended.
enum Ending {
    Done,
    Stopped,
    Failed(Fault, Vec<String>),
}

/// Runs the plan to its end; the exit code.
pub fn run(plan: Plan, resume: bool) -> u8 {
    match Supervisor::new(plan).and_then(|supervisor| supervisor.run(resume)) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("replica-launch: {error}");
            exit::FAILED
        }
    }
}

struct Supervisor {
    plan: Plan,
    folder: RunFolder,
    domain: Domain,
    screen: Screen,
    signals: Signals,
    /// Signals so far: the first drains, the second stops.
    n_signals: u32,
    faults: Vec<Fault>,
    /// CPU time of all processes so far, by stage.
    cpu_s: BTreeMap<String, f64>,
    health: BTreeMap<String, Health>,
    begun: Instant,
    restarts: u32,
    peak_shared_memory: u64,
}

impl Supervisor {
    fn new(mut plan: Plan) -> Result<Self, String> {
        let signals = Signals::new([SIGINT, SIGTERM, SIGHUP, SIGQUIT]).map_err(|error| error.to_string())?;
        let folder = RunFolder::lock(&plan.context.output)?;
        let absolute = |path: &Path| path.canonicalize().map_err(|error| format!("{}: {error}", path.display()));
        plan.context.output = absolute(&plan.context.output)?;
        let mut screen = Screen::new();
        if let Some(simulate) = plan.simulate.take() {
            screen.say(&format!("{} is not there: simulating it", plan.context.drive.display()));
            programs::simulate(&simulate, &plan.context.drive)?;
        }
        plan.context.drive = absolute(&plan.context.drive)?;
        Ok(Self {
            domain: folder.domain()?,
            plan,
            folder,
            screen,
            signals,
            n_signals: 0,
            faults: Vec::new(),
            cpu_s: BTreeMap::new(),
            health: BTreeMap::new(),
            begun: Instant::now(),
            restarts: 0,
            peak_shared_memory: 0,
        })
    }

    fn run(mut self, resume: bool) -> Result<u8, String> {
        let mut resume = if resume {
            self.folder.resume(&self.plan)?;
            let barrier = self.folder.last_complete_barrier(&self.plan.stages);
            self.screen.say(&format!("resuming from {}", place(barrier)));
            barrier
        } else {
            self.folder.begin(&self.plan)?;
            None
        };
        let outcome = loop {
            // What a killed run left of this domain goes first; nobody of it is alive while we hold the lock.
            self.domain.wipe().map_err(|error| error.to_string())?;
            let ending = self.attempt(resume);
            self.domain.wipe().map_err(|error| error.to_string())?;
            match ending? {
                // A source that was at its end anyway has nothing left out.
                Ending::Done if self.was_cut_short() => break "drained",
                Ending::Done => break "done",
                Ending::Stopped => break "stopped",
                Ending::Failed(fault, last_words) => {
                    self.report(&fault, &last_words);
                    let give_up = !fault.may_restart || self.restarts >= self.plan.run.restarts || self.n_signals > 0;
                    self.faults.push(fault);
                    if give_up {
                        break "failed";
                    }
                    resume = self.folder.last_complete_barrier(&self.plan.stages);
                    self.pause_before_restart(resume);
                    if self.n_signals > 0 {
                        break "stopped";
                    }
                    self.restarts += 1;
                }
            }
        };
        self.finish(outcome)
    }

    /// Starts everything, watches it to its end, and leaves no process behind.
    fn attempt(&mut self, resume: Option<u64>) -> Result<Ending, String> {
        let node = self.domain.node("supervisor").map_err(|error| error.to_string())?;
        let _keeper = self.create_services(&node).map_err(|error| error.to_string())?;
        let mut processes: Vec<StageProcess> = Vec::new();
        let ending = self.start(&node, resume, &mut processes).and_then(|()| self.watch(&mut processes));
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
            // Each topic is rung twice, for messages and for ticks, by each consumer or by its producer.
            let consumers: usize = stage.outputs.iter().map(|topic| topic.messages.consumers.len()).sum();
            keeper.create_wake(node, &wake_name(&stage.name), 2 * (consumers + stage.inputs.len()))?;
        }
        Ok(keeper)
    }

    fn start(&mut self, node: &Node, resume: Option<u64>, processes: &mut Vec<StageProcess>) -> Result<(), String> {
        for stage in &self.plan.stages {
            let assignment = self.folder.assign(&self.plan, stage, &self.domain, resume)?;
            processes.push(StageProcess::start(stage, &assignment, self.folder.log(&stage.name), node)?);
        }
        Ok(())
    }

    fn watch(&mut self, processes: &mut [StageProcess]) -> Result<Ending, String> {
        let mut command = Command::default();
        let mut forgotten = 0;
        loop {
            for process in processes.iter_mut() {
                process.observe().map_err(|error| error.to_string())?;
            }
            self.peak_shared_memory = self.peak_shared_memory.max(self.domain.used_bytes());
            self.screen.show(processes);
            if let Some(fault) = first_fault(processes, &self.plan.stages, &self.plan.run) {
                let last_words = processes.iter().find(|p| p.name == fault.stage).map(StageProcess::last_words);
                return Ok(Ending::Failed(fault, last_words.unwrap_or_default()));
            }
            if processes.iter().all(|process| process.status.is_some()) {
                return Ok(Ending::Done);
            }
            self.take_signals(&mut command);
            if self.n_signals > 1 {
                stop(processes);
                return Ok(Ending::Stopped);
            }
            if !command.go && processes.iter().all(is_ready) {
                command.go = true;
                self.screen.begin();
                // Later attempts belong to the same run: its clock goes on.
                if self.faults.is_empty() {
                    self.begun = Instant::now();
                }
            }
            for process in processes.iter().filter(|process| process.status.is_none()) {
                process.tell(command).map_err(|error| error.to_string())?;
            }
            let complete = processes.iter().map(|process| process.health.barrier).min().unwrap_or_default();
            if complete > forgotten {
                self.folder.forget_before(complete);
                forgotten = complete;
            }
            std::thread::sleep(LOOK);
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

    fn was_cut_short(&self) -> bool {
        let source = self.plan.stages.first().and_then(|source| self.health.get(&source.name));
        source.is_some_and(|health| health.drained)
    }

    fn report(&mut self, fault: &Fault, last_words: &[String]) {
        self.screen.say(&format!("[{}] {}", fault.stage, fault.text));
        for line in last_words {
            self.screen.say(&format!("[{}] | {line}", fault.stage));
        }
        if last_words.is_empty() {
            self.screen.say(&format!("[{}] | (nothing in {})", fault.stage, self.folder.log(&fault.stage).display()));
        }
    }

    fn pause_before_restart(&mut self, resume: Option<u64>) {
        let delay = Duration::from_millis((self.plan.run.restart_delay_s * 1000.0) as u64)
            .saturating_mul(1_u32.checked_shl(self.restarts).unwrap_or(u32::MAX))
            .min(MAX_DELAY);
        let from = place(resume);
        let allowed = self.plan.run.restarts;
        self.screen.say(&format!(
            "restart {} of {allowed} from {from} in {:.1} s",
            self.restarts + 1,
            delay.as_secs_f64()
        ));
        let begun = Instant::now();
        while begun.elapsed() < delay && self.n_signals == 0 {
            std::thread::sleep(LOOK.min(delay));
            self.n_signals += self.signals.pending().count() as u32;
        }
    }

    fn finish(mut self, outcome: &'static str) -> Result<u8, String> {
        let wall_s = self.begun.elapsed().as_secs_f64();
        let sink = self.plan.stages.last().and_then(|sink| self.health.get(&sink.name)).cloned();
        let stages: Vec<StageSummary> = self
            .plan
            .stages
            .iter()
            .map(|stage| {
                let health = self.health.remove(&stage.name).unwrap_or_default();
                let faults = self.faults.iter().filter(|fault| fault.stage == stage.name).count() as u32;
                let cpu_s = self.cpu_s.get(&stage.name).copied().unwrap_or_default();
                StageSummary::new(&stage.name, &stage.program, health, cpu_s, faults, wall_s)
            })
            .collect();
        let drive_s =
            sink.and_then(|h| Some(h.drive_time?.saturating_sub(h.drive_begin?) as f64 * 1e-9)).unwrap_or_default();
        let total = self.total(&stages, drive_s, wall_s);
        let incomplete = outcome == "drained";
        let faults = self.faults.iter().map(|fault| format!("[{}] {}", fault.stage, fault.text)).collect();
        let summary = Summary { outcome, faults, total, stages };
        summary.write(&self.plan.context.output)?;
        let total = &summary.total;
        self.screen.say(&format!(
            "{outcome}: {:.1} s of drive in {:.1} s ({:.2} times real time), {:.2} M points, {} restarts; see {}",
            total.drive_s,
            total.wall_s,
            total.times_real_time,
            total.points as f64 * 1e-6,
            total.restarts,
            self.plan.context.output.join("summary.json").display()
        ));
        Ok(match outcome {
            "done" => exit::DONE,
            _ if incomplete => exit::INCOMPLETE,
            _ => exit::FAILED,
        })
    }

    fn total(&self, stages: &[StageSummary], drive_s: f64, wall_s: f64) -> Total {
        // The plan is in the order of the dataflow: the sink comes last.
        let Some(sink) = stages.last() else { return Total::default() };
        Total {
            drive_s,
            wall_s,
            times_real_time: if wall_s > 0.0 { drive_s / wall_s } else { 0.0 },
            points: sink.points,
            points_per_s: rate(sink.points, wall_s),
            cpu_s: stages.iter().map(|stage| stage.cpu_s).sum(),
            peak_shared_memory_bytes: self.peak_shared_memory,
            restarts: self.restarts,
            latency: sink.age,
        }
    }
}

/// Where a run goes on, in words.
fn place(barrier: Option<u64>) -> String {
    barrier.map_or("the beginning".to_owned(), |barrier| format!("barrier {barrier}"))
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
