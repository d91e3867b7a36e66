//! The life of a run: make the drive, start the stages, watch, restart from the last barrier, sum up.

mod attempt;
mod conclusion;
mod live;

use crate::control::Control;
use crate::costs::Costs;
use crate::events::Log;
use crate::exhausted::{Means, lacks_shared_memory};
use crate::metrics::Metrics;
use crate::plan::Plan;
use crate::programs;
use crate::recorder::Recorder;
use crate::run_folder::RunFolder;
use crate::screen::Screen;
use crate::swap::Swap;
use crate::swap_record::SwapRecord;
use crate::watch::Fault;
use ipc::Domain;
use live::LiveRestarts;
use serde_json::json;
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::iterator::Signals;
use stage::health::Health;
use stage::{Mode, exit};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How often the supervisor looks: a twentieth of a second is soon enough for people.
const LOOK: Duration = Duration::from_millis(50);
/// The longest pause before a restart.
const MAX_DELAY: Duration = Duration::from_secs(30);

/// The pause before restart number `n`, counted from 0.
fn backoff(first_delay_s: f64, n: u32) -> Duration {
    let factor = 1_u32.checked_shl(n).unwrap_or(u32::MAX);
    Duration::from_millis((first_delay_s * 1000.0) as u64).saturating_mul(factor).min(MAX_DELAY)
}

/// How an attempt ended.
pub(crate) enum Ending {
    Done,
    Stopped,
    Failed(Fault, Vec<String>),
    /// All have come to this barrier, for a stage to be replaced.
    Swap(u64),
}

/// What the supervisor does beside running the plan.
pub struct Asides {
    /// How it speaks.
    pub log: Log,
    /// File of the figures in Prometheus' format.
    pub metrics: Option<PathBuf>,
    /// Recording of the plan's recorded topics.
    pub record: Option<PathBuf>,
}

/// Runs the plan to its end; the exit code.
pub fn run(plan: Plan, resume: bool, asides: Asides) -> u8 {
    let log = asides.log;
    match Supervisor::new(plan, asides).and_then(|supervisor| supervisor.run(resume)) {
        Ok(code) => code,
        Err(error) => {
            Screen::new(log).say(&format!("replica-launch: {error}"));
            exit::FAILED
        }
    }
}

pub(crate) struct Supervisor {
    pub(crate) plan: Plan,
    pub(crate) folder: RunFolder,
    domain: Domain,
    means: Means,
    pub(crate) screen: Screen,
    metrics: Metrics,
    /// `None` live: a run that never ends would fill the disk.
    costs: Option<Costs>,
    signals: Signals,
    recorder: Option<Recorder>,
    pub(crate) control: Control,
    /// Signals so far: the first drains, the second stops.
    pub(crate) n_signals: u32,
    /// The swap under way.
    pub(crate) swap: Option<Swap>,
    pub(crate) record: SwapRecord,
    faults: Vec<Fault>,
    /// CPU time of all processes so far, by stage.
    cpu_s: BTreeMap<String, f64>,
    /// Each stage's last heartbeat of the last attempt.
    pub(crate) health: BTreeMap<String, Health>,
    begun: Instant,
    /// CPU time of this process at `begun`, s.
    own_cpu_s: f64,
    restarts: u32,
    /// Restarts since a barrier was reached for the first time.
    restarts_in_place: u32,
    live: LiveRestarts,
    /// How often the processes have been started.
    attempts: u32,
    peak_shared_memory: u64,
}

impl Supervisor {
    fn new(mut plan: Plan, asides: Asides) -> Result<Self, String> {
        let metrics = Metrics::new(asides.metrics.as_deref())?;
        let signals = Signals::new([SIGINT, SIGTERM, SIGHUP, SIGQUIT]).map_err(|error| error.to_string())?;
        let folder = RunFolder::lock(&plan.context.output)?;
        let absolute = |path: &Path| path.canonicalize().map_err(|error| format!("{}: {error}", path.display()));
        plan.context.output = absolute(&plan.context.output)?;
        let mut screen = Screen::new(asides.log);
        if let Some(remark) = &plan.remark {
            screen.say(remark);
        }
        if let Some(simulate) = plan.simulate.take() {
            screen.say(&format!("{} is not there: simulating it", plan.context.drive.display()));
            programs::simulate(&simulate, &plan.context.launch_folder, &plan.context.drive)?;
        }
        if plan.context.mode == Mode::Offline {
            plan.context.drive = absolute(&plan.context.drive)?;
        }
        let domain = folder.domain()?;
        Ok(Self {
            control: Control::open(&domain)?,
            means: Means::new(&domain, &plan.context.output),
            domain,
            recorder: asides.record.map(|file| Recorder::of(&plan, file)),
            costs: (plan.context.mode == Mode::Offline).then(|| Costs::new(folder.costs())),
            plan,
            folder,
            screen,
            metrics,
            signals,
            n_signals: 0,
            swap: None,
            record: SwapRecord::default(),
            faults: Vec::new(),
            cpu_s: BTreeMap::new(),
            health: BTreeMap::new(),
            begun: Instant::now(),
            own_cpu_s: 0.0,
            restarts: 0,
            restarts_in_place: 0,
            live: LiveRestarts::default(),
            attempts: 0,
            peak_shared_memory: 0,
        })
    }

    fn run(mut self, resume: bool) -> Result<u8, String> {
        if resume && self.is_live() {
            return Err("a live run cannot be resumed: what came meanwhile is gone; begin a new one".to_owned());
        }
        let mut resume = if resume && self.folder.has_begun() {
            self.folder.resume(&self.plan)?;
            self.take_up_swaps()?;
            let barrier = self.last_barrier()?;
            if barrier.is_some() && self.recorder.is_some() {
                return Err("a recording begins with its run: leave --record out, or begin anew".to_owned());
            }
            self.screen.say(&format!("resuming from {}", place(barrier)));
            barrier
        } else {
            if resume {
                self.screen.say("no run was begun here: beginning");
            }
            self.folder.begin(&self.plan)?;
            None
        };
        let mut furthest = resume;
        let outcome = loop {
            // What a killed run left of this domain goes first; nobody of it is alive while we hold the lock.
            self.domain.wipe().map_err(|error| error.to_string())?;
            self.folder.forget_after(resume)?;
            let ending = self.attempt(resume);
            self.domain.wipe().map_err(|error| error.to_string())?;
            if let Some(barrier) = self.undo_swap(&ending)? {
                resume = Some(barrier);
                continue;
            }
            match ending? {
                // A source that was at its end anyway has nothing left out, and a live one ends when it is asked to.
                Ending::Done if self.was_cut_short() && !self.is_live() => break "drained",
                Ending::Done => break "done",
                Ending::Stopped => break "stopped",
                Ending::Swap(barrier) => {
                    resume = self.exchange(barrier)?;
                }
                Ending::Failed(fault, _) if self.is_live() => {
                    self.faults.push(fault);
                    break "failed";
                }
                Ending::Failed(fault, _) => {
                    resume = self.last_barrier()?;
                    if resume > furthest {
                        furthest = resume;
                        self.restarts_in_place = 0;
                    }
                    let may_restart = fault.may_restart && self.restarts_in_place < self.plan.run.restarts;
                    self.faults.push(fault);
                    if self.n_signals > 0 {
                        break "failed";
                    }
                    let lack = lacks_shared_memory(None);
                    if !may_restart || lack.is_some() {
                        if let Some(lack) = lack {
                            self.screen.say(&lack);
                        }
                        self.screen.say(&format!("given up; --resume would go on from {}", place(resume)));
                        break "failed";
                    }
                    self.pause_before_restart(resume);
                    if self.n_signals > 0 {
                        break "stopped";
                    }
                    self.restarts += 1;
                    self.restarts_in_place += 1;
                }
            }
        };
        self.finish(outcome)
    }

    /// The last barrier that is whole. What went before a swap is the old plan's, and no place to go on from.
    pub(crate) fn last_barrier(&mut self) -> Result<Option<u64>, String> {
        let screen = &mut self.screen;
        let barrier = self.folder.last_whole_barrier(&self.plan.stages, |text| screen.say(text));
        let swapped = self.record.swaps.iter().rfind(|swap| swap.undone.is_none());
        match swapped {
            Some(swap) if barrier < Some(swap.barrier) => Err(format!(
                "no barrier since {} was swapped at barrier {} is whole: the run has to be begun anew",
                swap.stage, swap.barrier
            )),
            _ => Ok(barrier),
        }
    }

    fn report(&mut self, fault: &Fault, last_words: &[String]) {
        self.screen.fault(fault, last_words, &self.folder.log(&fault.stage));
    }

    fn pause_before_restart(&mut self, resume: Option<u64>) {
        let delay = backoff(self.plan.run.restart_delay_s, self.restarts_in_place);
        let from = place(resume);
        let allowed = self.plan.run.restarts;
        let restart = self.restarts_in_place + 1;
        let text = format!("restart {restart} of {allowed} from {from} in {:.1} s", delay.as_secs_f64());
        let fields = json!({"restart": restart, "allowed": allowed, "barrier": resume, "delay_s": delay.as_secs_f64()});
        self.screen.tell("restart", &text, fields);
        let begun = Instant::now();
        while begun.elapsed() < delay && self.n_signals == 0 {
            std::thread::sleep(LOOK.min(delay));
            self.n_signals += self.signals.pending().count() as u32;
            self.look_at_requests();
        }
    }
}

/// Where a run goes on, in words.
fn place(barrier: Option<u64>) -> String {
    barrier.map_or("the beginning".to_owned(), |barrier| format!("barrier {barrier}"))
}
