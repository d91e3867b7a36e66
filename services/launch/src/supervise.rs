//! The life of a run: simulate the drive, start the stages, observe them, restart from the last barrier, write the summary.
//!
//! | file | content |
//! |---|---|
//! | `attempt` | one attempt: start, observe, decide, end all processes |
//! | `check_resume` | whether `--resume` would continue the run in the output |
//! | `services` | the IPC services that the stages open |
//! | `report` | `replica report` after the run |
//! | `processes` | the processes of an attempt |
//! | `stage_restarts` | live: stages that are down, and their restarts |
//! | `operator` | signals and requests |
//! | `observers` | recorder, metrics, costs, progress |
//! | `account` | faults, CPU time and last heartbeats, for the summary |
//!
//! The decisions and their reasons are in [`crate::decision`].

mod account;
mod attempt;
mod check_resume;
mod error;
mod observers;
mod operator;
mod processes;
mod report;
mod services;
mod stage_restarts;

use crate::active_run::ActiveRun;
use crate::control::Control;
use crate::decision::{FailedAttempt, Fault, GiveUp, Policy, RestartBudget, RunDecision, restart_run};
use crate::identity::Files;
use crate::log::LogFormat;
use crate::plan::Plan;
use crate::programs;
use crate::resources::{Resources, lacks_shared_memory};
use crate::run_folder::{Patience, RunFolder, RunFolderError, canonical};
use crate::swap::Swaps;
use account::Account;
use attempt::Ending;
pub use check_resume::check_resume;
use error::SuperviseError;
use observers::Observers;
use operator::Operator;
use run::summary::{REPORT_FILES, Summary};
use run::{Mode, Outcome, exit};
use signal_hook::consts::SIGTERM;
use stage_restarts::StageRestarts;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Interval between two observations: a twentieth of a second is soon enough for people.
const POLL: Duration = Duration::from_millis(50);

/// Treatment of an earlier run in the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The results are kept: a new run is refused.
    New,
    /// A new run replaces the results.
    Overwrite,
    /// The run is continued from its last barrier.
    Resume,
}

/// Options of the command line that are not part of the plan.
pub struct Options {
    /// Treatment of an earlier run in the output.
    pub start: Start,
    /// Format of the supervisor's events and of the stages' logs.
    pub log: LogFormat,
    /// File of the metrics in Prometheus' format.
    pub metrics: Option<PathBuf>,
    /// Recording of the plan's recorded topics.
    pub record: Option<PathBuf>,
    /// Longest wait for another run that writes into the output.
    pub wait: Duration,
}

/// Runs the plan to its end. Returns the exit code.
pub fn run(plan: Plan, options: Options) -> u8 {
    let _span = tracing::info_span!("run", output = %plan.context.output.display()).entered();
    match Supervisor::new(plan, options).and_then(Supervisor::run) {
        Ok(code) => code,
        Err(error) => {
            tracing::error!("replica-launch: {error}");
            error.exit_code()
        }
    }
}

struct Supervisor {
    run: ActiveRun,
    start: Start,
    format: LogFormat,
    operator: Operator,
    observers: Observers,
    resources: Resources,
    account: Account,
    swaps: Swaps,
    stage_restarts: StageRestarts,
    /// Number of times the processes were started.
    attempts: u32,
    /// Origin of all observed times.
    origin: Instant,
}

impl Supervisor {
    fn new(mut plan: Plan, options: Options) -> Result<Self, SuperviseError> {
        let Options { start, log: format, metrics, record, wait } = options;
        let mut signals = operator::signals()?;
        let metrics = observers::metrics(metrics.as_deref())?;
        let is_over = &mut || signals.pending().count() > 0;
        let folder = RunFolder::lock(&plan.context.output, &mut Patience { wait, is_over })?;
        plan.context.output = canonical(&plan.context.output)?;
        // Checked before the drive is simulated, which takes minutes.
        if start == Start::New || (start == Start::Resume && !folder.has_begun()) {
            folder.refuse_earlier_results()?;
        }
        if let Some(remark) = &plan.remark {
            tracing::info!("{remark}");
        }
        if let Some(simulate) = plan.simulate.take() {
            tracing::info!("{} does not exist: simulating it", plan.context.drive.display());
            programs::simulate(&simulate, &plan.context.launch_folder, &plan.context.drive)?;
        }
        if plan.context.mode == Mode::Offline {
            plan.context.drive = canonical(&plan.context.drive)?;
        }
        let domain = folder.domain()?;
        Ok(Self {
            start,
            format,
            operator: Operator::new(signals, Control::open(&domain)?),
            observers: Observers::new(format, metrics, record, &plan, &folder),
            resources: Resources::new(&domain, &plan.context.output),
            account: Account::new(),
            swaps: Swaps::default(),
            stage_restarts: StageRestarts::default(),
            attempts: 0,
            origin: Instant::now(),
            run: ActiveRun { plan, folder, files: Files::default(), domain },
        })
    }

    fn run(mut self) -> Result<u8, SuperviseError> {
        if let Some(summary) = self.finished_run()? {
            return Ok(self.finish_files(&summary));
        }
        let mut from = self.begin()?;
        let mut budget = RestartBudget { barrier: from, used: 0 };
        let outcome = loop {
            // The lock is held, so no process of this run is alive: shared memory left by a killed run is removed.
            self.run.domain.wipe()?;
            self.run.folder.states().remove_after(from)?;
            self.refuse_changed_files()?;
            let ending = self.attempt(from);
            self.run.domain.wipe()?;
            if let Err(SuperviseError::Folder(RunFolderError::LeaseLost { .. })) = ending {
                return ending.map(|_| exit::FAILED);
            }
            if let Some(reason) = failure(&ending)
                && let Some(barrier) = self.swaps.undo(reason, &mut self.run, &mut self.operator.control)?
            {
                from = Some(barrier);
                continue;
            }
            match ending? {
                Ending::Done => break self.outcome_of_finished_run(),
                Ending::Stopped => break Outcome::Stopped,
                Ending::Swap(barrier) => {
                    let health = &self.account.health;
                    from = self.swaps.exchange(barrier, health, &mut self.run, &mut self.operator.control)?;
                }
                Ending::Failed { fault, .. } if self.run.is_live() => {
                    self.account.faults.push(fault);
                    break Outcome::Failed;
                }
                Ending::Failed { fault, .. } => {
                    from = self.swaps.last_barrier(&self.run)?;
                    match self.restart_run(fault, from, budget) {
                        Ok(restarted) => budget = restarted,
                        Err(outcome) => break outcome,
                    }
                }
            }
        };
        self.finish(outcome)
    }

    /// The summary of the run to resume, if it is done: then only files after the summary may be missing.
    fn finished_run(&mut self) -> Result<Option<Summary>, SuperviseError> {
        let may_be_done = self.start == Start::Resume && self.run.folder.has_begun();
        if !may_be_done || self.run.is_live() || self.observers.is_recording() {
            return Ok(None);
        }
        let summary = Summary::load(&self.run.plan.context.output).ok();
        let Some(summary) = summary.filter(|summary| summary.outcome == Outcome::Done) else { return Ok(None) };
        self.run.files = self.files()?;
        self.run.folder.refuse_other_plan(&self.run.plan, &self.run.files)?;
        self.run.domain.wipe()?;
        tracing::info!("the run in this output is done");
        Ok(Some(summary))
    }

    /// Starts a new run or resumes the one in the output. Returns the barrier to start from.
    fn begin(&mut self) -> Result<Option<u64>, SuperviseError> {
        let resume = self.start == Start::Resume;
        self.run.files = self.files()?;
        if resume && self.run.is_live() {
            return Err(SuperviseError::LiveResume);
        }
        if !resume || !self.run.folder.has_begun() {
            if resume {
                tracing::info!("no run to resume in this output: starting a new one");
            }
            self.run.folder.begin(&self.run.plan, &self.run.files)?;
            return Ok(None);
        }
        self.run.folder.resume(&self.run.plan, &self.run.files)?;
        self.swaps.restore(&mut self.run)?;
        self.run.files = self.files()?;
        let barrier = self.swaps.last_barrier(&self.run)?;
        if barrier.is_some() && self.observers.is_recording() {
            return Err(SuperviseError::RecordingResume);
        }
        tracing::info!(barrier, "resuming from {}", place(barrier));
        Ok(barrier)
    }

    /// The current files of the plan.
    fn files(&self) -> Result<Files, RunFolderError> {
        Ok(Files::read(&self.run.plan, &self.run.files)?)
    }

    /// All attempts use the same programs and models; only a swap replaces files of a stage.
    fn refuse_changed_files(&mut self) -> Result<(), SuperviseError> {
        let files = self.files()?;
        self.run.folder.refuse_changed_files(&files, &self.run.files, self.swaps.replaced_stage())?;
        self.run.files = files;
        Ok(())
    }

    /// Waits for the restart of the run that [`restart_run`] allows. Returns the budget after it. `Err`: the outcome of
    /// the run if no restart is allowed.
    fn restart_run(
        &mut self,
        fault: Fault,
        barrier: Option<u64>,
        budget: RestartBudget,
    ) -> Result<RestartBudget, Outcome> {
        // The signal that ended the stage may also have been sent to this process.
        self.operator.poll(&mut self.swaps, &self.run);
        let lack = lacks_shared_memory(None);
        let policy = Policy::new(&self.run.plan.settings, &self.run.plan.stages);
        let attempt = FailedAttempt {
            fault: &fault,
            is_ending: self.operator.is_ending(),
            barrier,
            budget,
            is_memory_low: lack.is_some(),
        };
        let decision = restart_run(&attempt, &policy);
        let is_terminated = fault.signal() == Some(SIGTERM);
        self.account.faults.push(fault);
        match decision {
            RunDecision::Restart { delay, budget } => {
                self.pause_before_restart(delay, budget.used, barrier);
                if self.operator.is_ending() {
                    return Err(Outcome::Stopped);
                }
                self.account.restarts += 1;
                Ok(budget)
            }
            // A stage that got the SIGTERM of its whole job before it could ignore it: the run continues another time.
            RunDecision::GiveUp(GiveUp::EndRequested) if is_terminated => Err(Outcome::Stopped),
            RunDecision::GiveUp(GiveUp::EndRequested) => Err(Outcome::Failed),
            RunDecision::GiveUp(reason) => {
                if let Some(lack) = lack {
                    tracing::error!("{lack}");
                }
                tracing::error!(barrier, "giving up: {reason}; --resume would continue from {}", place(barrier));
                Err(Outcome::Failed)
            }
        }
    }

    fn pause_before_restart(&mut self, delay: Duration, restart: u32, barrier: Option<u64>) {
        let allowed = self.run.plan.settings.restarts;
        let delay_s = delay.as_secs_f64();
        tracing::warn!(
            kind = "restart",
            restart,
            allowed,
            barrier,
            delay_s,
            "restart {restart} of {allowed} from {} in {delay_s:.1} s",
            place(barrier)
        );
        let begun = Instant::now();
        while begun.elapsed() < delay && !self.operator.is_ending() {
            std::thread::sleep(POLL.min(delay));
            self.operator.poll(&mut self.swaps, &self.run);
        }
    }

    /// The outcome of a finished run. An offline source that was asked to end has left out the rest of its drive; a
    /// live one ends only on request.
    fn outcome_of_finished_run(&self) -> Outcome {
        let source = self.run.plan.stages.first().and_then(|source| self.account.health.get(&source.name));
        let is_cut_short = source.is_some_and(|health| health.drained);
        if is_cut_short && !self.run.is_live() { Outcome::Drained } else { Outcome::Done }
    }

    /// Writes the summary and ends the observers. Returns the exit code.
    fn finish(mut self, outcome: Outcome) -> Result<u8, SuperviseError> {
        if self.run.is_live() {
            // No other run continues a live one.
            self.run.folder.refuse_lost_lease()?;
        } else {
            self.run.folder.refuse_invalid_lease()?;
        }
        let wall_s = self.account.wall_s();
        self.observers.write_last(&self.account.health, &self.run.domain, self.account.restarts);
        self.swaps.close(&mut self.operator.control);
        let swaps = self.swaps.take_all();
        let summary = self.account.summary(&self.run.plan, outcome, swaps, wall_s);
        summary.write(&self.run.plan.context.output)?;
        // The recorder reads from the summary that the run was cut short, so it ends only now.
        let is_recorded = self.observers.finish_recording(outcome);
        Ok(match self.finish_files(&summary) {
            exit::DONE if !is_recorded => exit::INCOMPLETE,
            code => code,
        })
    }

    /// Ends the control socket, removes the states and writes the report. Returns the exit code. A supervisor that is
    /// killed before the last step leaves states or no report: `--resume` then repeats these steps.
    fn finish_files(&mut self, summary: &Summary) -> u8 {
        let outcome = summary.outcome;
        let output = &self.run.plan.context.output;
        self.operator.control.end(outcome);
        account::log_summary(summary, output);
        // A stopped run ends at once, as requested.
        if self.run.plan.settings.report && outcome != Outcome::Stopped && !has_report(output) {
            report::write(output);
        }
        if outcome == Outcome::Done {
            // Nothing is left to continue.
            self.run.folder.states().remove_before(u64::MAX);
        }
        summary.exit_code(self.run.is_live())
    }
}

/// Whether the output has the report of its run: a new run and a resumed one remove it.
fn has_report(output: &Path) -> bool {
    REPORT_FILES.iter().all(|name| output.join(name).exists())
}

/// The reason why an attempt failed, for the client that requested a swap.
fn failure(ending: &Result<Ending, SuperviseError>) -> Option<String> {
    match ending {
        Ok(Ending::Failed { fault, log_lines }) => {
            let lines = log_lines.iter().map(|line| format!("[{}] | {line}", fault.stage));
            Some(std::iter::once(fault.to_string()).chain(lines).collect::<Vec<_>>().join("\n"))
        }
        Err(error) => Some(error.to_string()),
        Ok(_) => None,
    }
}

/// The point from which a run continues.
fn place(barrier: Option<u64>) -> String {
    barrier.map_or("the beginning".to_owned(), |barrier| format!("barrier {barrier}"))
}
