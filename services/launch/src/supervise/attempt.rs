//! One attempt of a run: starts and observes services and processes, and ends all of them.

use super::error::SuperviseError;
use super::processes::Processes;
use super::{POLL, Supervisor, services};
use crate::decision::cause::Cause;
use crate::decision::{Fault, FaultyStage, Judgment, Policy, StageDecision, judge, restart_stage};
use crate::log::Json;
use ipc::{Node, ServiceHandles};
use run::assignment::Command;
use serde_json::Value;
use std::time::{Duration, Instant};

/// Interval between two observations while the pipeline waits for a swap.
const POLL_FAST: Duration = Duration::from_millis(10);
/// Longest time for which a killed lossless observer blocks its producer.
const CLEAN_EVERY: Duration = Duration::from_secs(1);
/// Number of polls until a command is published again: a stage that has just connected needs it.
const COMMAND_EVERY: u64 = 4;
/// Number of polls until shared memory is measured again: the sizes of all its files cost more than the rest of a poll.
const MEASURE_EVERY: u64 = 20;

/// The end of an attempt.
pub(super) enum Ending {
    Done,
    Stopped,
    Failed {
        fault: Fault,
        log_lines: Vec<String>,
    },
    /// All stages have reached this barrier, where one is to be replaced.
    Swap(u64),
}

/// The services of an attempt, and the node that holds them open.
struct Ipc {
    services: ServiceHandles,
    node: Node,
}

/// State kept between the polls of an attempt.
#[derive(Default)]
struct Polls {
    count: u64,
    command: Command,
    published: Option<Command>,
    /// The last barrier that all stages have reached.
    barrier: u64,
    cleaned: Option<Instant>,
}

impl Supervisor {
    /// Starts all stages from a barrier, observes them to their end, and leaves no process behind.
    pub(super) fn attempt(&mut self, from: Option<u64>) -> Result<Ending, SuperviseError> {
        let _span = tracing::info_span!("attempt", attempt = self.attempts, from).entered();
        let plan = &self.run.plan;
        // Written before the services: an observer that finds the services, and then still this wiring, can rely on
        // their belonging to it.
        self.run.folder.write_wiring(&plan.wiring(&self.run.domain, self.attempts))?;
        let node = self.run.domain.node("supervisor")?;
        self.run.domain.write_output(&plan.context.output)?;
        let ipc = Ipc { services: services::create(&node, &plan.stages)?, node };
        self.observers.start_attempt(self.attempts)?;
        self.attempts += 1;
        let mut processes = Processes::default();
        let started = processes.start(&self.run, &ipc.node, from, self.format);
        let ending = started.and_then(|()| self.observe_to_end(&ipc, &mut processes));
        processes.kill();
        for process in &processes.all {
            self.account.add_process(process);
        }
        ending
    }

    fn observe_to_end(&mut self, ipc: &Ipc, processes: &mut Processes) -> Result<Ending, SuperviseError> {
        let policy = Policy::new(&self.run.plan.settings, &self.run.plan.stages);
        let mut polls = Polls::default();
        loop {
            if let Some(ending) = self.poll(ipc, processes, &policy, &mut polls)? {
                return Ok(ending);
            }
            polls.count += 1;
            std::thread::sleep(if self.swaps.is_waited_for() { POLL_FAST } else { POLL });
        }
    }

    /// Observes all stages once and carries out the decisions.
    fn poll(
        &mut self,
        ipc: &Ipc,
        processes: &mut Processes,
        policy: &Policy,
        polls: &mut Polls,
    ) -> Result<Option<Ending>, SuperviseError> {
        let at = self.origin.elapsed();
        self.run.folder.refuse_lost_lease()?;
        polls.command.valid_until_nanos =
            if self.run.is_live() { u64::MAX } else { self.run.folder.valid_until_nanos() };
        processes.observe();
        if polls.count.is_multiple_of(MEASURE_EVERY) {
            self.account.measure_shared_memory(&self.run.domain);
        }
        self.observers.update(&processes.all, &self.run.domain, self.account.restarts);
        let is_finished = match judge(at, &processes.observed(self.origin), policy) {
            Judgment::Blame(fault) => return Ok(self.handle_fault(fault, processes, policy)),
            Judgment::Finish => true,
            Judgment::Continue => false,
        };
        self.operator.poll(&mut self.swaps, &self.run);
        let is_ending = self.operator.is_ending();
        let arrived = self.swaps.advance(&processes.all, &self.run, &mut self.operator.control, is_ending)?;
        polls.command.pause = self.swaps.is_draining();
        if let Some(barrier) = arrived {
            return Ok(Some(Ending::Swap(barrier)));
        }
        self.restart_due_stages(&ipc.node, processes)?;
        if is_finished {
            self.observers.show_last(&processes.all);
            return Ok(Some(Ending::Done));
        }
        if self.operator.must_stop() {
            processes.stop();
            return Ok(Some(Ending::Stopped));
        }
        self.start_sources_when_ready(processes, polls);
        if polls.published != Some(polls.command) || polls.count.is_multiple_of(COMMAND_EVERY) {
            processes.command(polls.command)?;
            polls.published = Some(polls.command);
        }
        self.remove_old_states(processes, polls);
        // A killed stage ends the attempt; a killed observer must not block its producer. Looking for one costs as much
        // as the rest of a poll.
        if ipc.services.have_observers() && polls.cleaned.get_or_insert_with(Instant::now).elapsed() > CLEAN_EVERY {
            // The next call removes observers that this one could not.
            let _is_complete = ipc.node.remove_dead_ports();
            polls.cleaned = Some(Instant::now());
        }
        Ok(None)
    }

    /// Finds the cause of the fault, reports it, and restarts the stage or ends the attempt.
    fn handle_fault(&mut self, mut fault: Fault, processes: &mut Processes, policy: &Policy) -> Option<Ending> {
        let _span = tracing::info_span!("stage", stage = %fault.stage).entered();
        let log_lines = processes.find(&fault.stage).map(|process| process.last_log_lines()).unwrap_or_default();
        fault.cause = Cause::from_evidence(fault.signal(), &self.resources.evidence(&log_lines));
        let history = self.stage_restarts.history(&fault.stage);
        let faulty = FaultyStage {
            fault: &fault,
            is_ending: self.operator.is_ending(),
            restarts: history.restarts,
            ran_for: history.ran_for,
        };
        let decision = restart_stage(&faulty, policy);
        if let StageDecision::Restart { delay, restart } = decision
            && let Some(process) = processes.find(&fault.stage)
        {
            process.kill();
            process.awaits_restart = true;
            let log_lines = process.last_log_lines();
            self.stage_restarts.schedule(&fault.stage, delay, restart);
            self.report_fault(&fault, &log_lines);
            let delay_s = delay.as_secs_f64();
            tracing::warn!(restart, delay_s, "[{}] restarts in {delay_s:.1} s; the others continue", fault.stage);
            self.account.faults.push(fault);
            return None;
        }
        // Reported at once: ending the rest of the attempt takes time.
        self.report_fault(&fault, &log_lines);
        if let StageDecision::GiveUp(reason) = decision {
            tracing::error!("giving up: {reason}");
        }
        Some(Ending::Failed { fault, log_lines })
    }

    fn report_fault(&self, fault: &Fault, log_lines: &[String]) {
        let lines: Vec<Value> = log_lines.iter().map(|line| log_line(line)).collect();
        tracing::error!(
            kind = "fault",
            stage = fault.stage,
            fault = fault.text(),
            fault_kind = fault.kind.name(),
            last_log_lines = %Json(&lines),
            log = %self.run.folder.log(&fault.stage).display(),
            "{fault}"
        );
    }

    /// Live: restarts the stages whose pause is over.
    fn restart_due_stages(&mut self, node: &Node, processes: &mut Processes) -> Result<(), SuperviseError> {
        let run = &self.run;
        let restarts = &mut self.stage_restarts;
        for process in processes.all.iter_mut().filter(|process| process.awaits_restart) {
            let stage = run.plan.stages.iter().find(|stage| stage.name == process.name);
            let Some(stage) = stage.filter(|stage| restarts.is_due(&stage.name)) else { continue };
            // The ports of the dead process must be free for the next one.
            if !node.remove_dead_ports() {
                continue;
            }
            self.account.add_cpu_time(process);
            self.account.restarts += 1;
            let from = run.folder.states().last_barrier_of(&stage.name);
            let restart = restarts.begin(process);
            let assignment = run.folder.assign(&run.plan, stage, &run.domain, from, Some(restart))?;
            process.restart(stage, &assignment, self.format)?;
        }
        Ok(())
    }

    /// Starts the sources when all stages and the recorder are ready. To drain, they start at once: no data is in
    /// flight yet.
    fn start_sources_when_ready(&mut self, processes: &Processes, polls: &mut Polls) {
        if self.operator.is_ending() && !polls.command.drain {
            polls.command.drain = true;
            polls.command.go = true;
            tracing::warn!("draining in-flight data; press Ctrl-C again to stop immediately");
        }
        if !polls.command.go && self.observers.are_ready() && processes.are_ready() {
            polls.command.go = true;
            // Later attempts belong to the same run: its clock continues.
            if self.attempts == 1 {
                self.observers.begin_progress();
                self.account.begin();
            }
        }
    }

    /// Removes old states. The barrier before the last complete one is also kept: the run falls back to it if a state
    /// of the last one is damaged.
    fn remove_old_states(&self, processes: &Processes, polls: &mut Polls) {
        let complete = processes.all.iter().map(|process| process.health.barrier).min().unwrap_or_default();
        if complete > polls.barrier {
            self.run.folder.states().remove_before(polls.barrier);
            polls.barrier = complete;
        }
    }
}

/// A line of a stage's log: an object if the log is JSON.
fn log_line(line: &str) -> Value {
    serde_json::from_str(line).ok().filter(Value::is_object).unwrap_or_else(|| line.into())
}
