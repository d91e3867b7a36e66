//! Replacing a stage of a running pipeline: check, drain to a barrier, try, and hold or undo. The reasons stand in
//! docs/swap.md.

use crate::check;
use crate::child::StageProcess;
use crate::control::AskerId;
use crate::fit::misfits;
use crate::plan::Plan;
use crate::supervise::{Ending, Supervisor};
use crate::swap_record::{Trying, changes};
use stage::assignment::Command;
use stage::control::{Answer, Request, SwapRequest, Swapped};
use stage::health::{Activity, Health};
use stage::{Mode, nearest_key};
use std::thread::JoinHandle;

/// A swap under way.
pub struct Swap {
    asker: AskerId,
    request: SwapRequest,
    phase: Phase,
}

enum Phase {
    /// Everything that can be known before is being looked at, aside: the run must not wait for it.
    Checking(JoinHandle<Result<Plan, Vec<String>>>),
    /// The source is to pause behind a barrier, and all others to come there.
    Draining(Box<Plan>),
    /// All have been started anew from there, and the sink has not finished a tick yet.
    Settling {
        /// What held before; `None` if it holds again.
        old: Option<Box<Plan>>,
        swapped: Box<Swapped>,
        /// Last tick of the sink before.
        last_tick_nanos: Option<u64>,
    },
}

impl Supervisor {
    /// Takes in what others ask for.
    pub(crate) fn look_at_requests(&mut self) {
        for (asker, request) in self.control.requests() {
            match request {
                Request::Stop { now } => {
                    self.n_signals = self.n_signals.max(if now { 2 } else { 1 });
                    self.control
                        .working(asker, if now { "stopping" } else { "draining: what is on the way is finished" });
                }
                Request::Swap(request) => {
                    if let Err(reason) = self.begin_swap(asker, request) {
                        self.control.answer(asker, &Answer::Refused(vec![reason]));
                    }
                }
            }
        }
    }

    fn begin_swap(&mut self, asker: AskerId, request: SwapRequest) -> Result<(), String> {
        if self.n_signals > 0 {
            return Err("the run is being drained".to_owned());
        }
        if let Some(other) = &self.swap {
            return Err(format!("a swap of [{}] is under way", other.request.stage));
        }
        if self.plan.context.mode == Mode::Live {
            return Err("a live run does not wait: nothing can be swapped in it without loss".to_owned());
        }
        if !self.plan.selection.recorded.is_empty() {
            return Err("the run is recorded: ticks of a swap that is undone could not be taken back".to_owned());
        }
        let names = self.plan.stages.iter().map(|stage| stage.name.as_str());
        if names.clone().all(|name| name != request.stage) {
            let hint = nearest_key(&request.stage, names).replace("unknown key", "no such stage in this run");
            return Err(format!("[{}]: {hint}", request.stage));
        }
        let overrides = self.overrides_with(&self.record.overrides_with(&request));
        let (copy, launch_file) = (self.folder.launch_copy(), self.plan.launch_file.clone());
        let selection = self.plan.selection.clone();
        let thread = std::thread::Builder::new().name("check".to_owned());
        let checking = thread.spawn(move || check::plan_as(&copy, &launch_file, &overrides, &selection));
        let checking = checking.map_err(|error| format!("the check cannot be begun: {error}"))?;
        self.control.working(asker, "checking");
        self.swap = Some(Swap { asker, request, phase: Phase::Checking(checking) });
        Ok(())
    }

    /// The command line's overrides with others than those of swaps behind them.
    fn overrides_with(&self, swapped: &[String]) -> Vec<String> {
        let n_asked = self.plan.overrides.len().saturating_sub(self.record.overrides.len());
        [&self.plan.overrides[..n_asked], swapped].concat()
    }

    /// Whether a swap waits for the processes: then it is worth looking more often.
    pub(crate) fn is_swapping(&self) -> bool {
        self.swap.as_ref().is_some_and(|swap| !matches!(swap.phase, Phase::Checking(_)))
    }

    /// Brings the swap under way one step further, if it is time to.
    pub(crate) fn advance_swap(
        &mut self,
        processes: &[StageProcess],
        command: &mut Command,
    ) -> Result<Option<Ending>, String> {
        let Some(Swap { asker, request, phase }) = self.swap.take() else { return Ok(None) };
        let mut ending = None;
        let phase = match phase {
            Phase::Checking(thread) if !thread.is_finished() => Some(Phase::Checking(thread)),
            Phase::Checking(thread) => {
                let checked = thread.join().unwrap_or_else(|_| Err(vec!["the check panicked".to_owned()]));
                match checked.and_then(|plan| self.fitting(plan, &request.stage)) {
                    Ok(plan) => {
                        self.control.working(asker, "draining to a barrier");
                        Some(Phase::Draining(Box::new(plan)))
                    }
                    Err(reasons) => {
                        self.control.answer(asker, &Answer::Refused(reasons));
                        None
                    }
                }
            }
            Phase::Draining(_) if self.n_signals > 0 => {
                command.pause = false;
                self.control.answer(asker, &Answer::Refused(vec!["the run is being drained".to_owned()]));
                None
            }
            Phase::Draining(plan) => {
                command.pause = true;
                ending = paused_at(processes).map(Ending::Swap);
                Some(Phase::Draining(plan))
            }
            Phase::Settling { old, mut swapped, last_tick_nanos } => {
                match processes.last().and_then(|sink| sink.health.first_tick_nanos) {
                    None => Some(Phase::Settling { old, swapped, last_tick_nanos }),
                    Some(first) => {
                        swapped.seconds_without_output =
                            last_tick_nanos.map(|last| first.saturating_sub(last) as f64 * 1e-9);
                        self.settle_swap(asker, *swapped)?;
                        None
                    }
                }
            }
        };
        self.swap = phase.map(|phase| Swap { asker, request, phase });
        Ok(ending)
    }

    /// The plan if it is that of this run but for the stage.
    fn fitting(&self, mut plan: Plan, stage: &str) -> Result<Plan, Vec<String>> {
        plan.context = self.plan.context.clone();
        let misfits = misfits(&self.plan.stages, &plan.stages, stage);
        if misfits.is_empty() { Ok(plan) } else { Err(misfits) }
    }

    /// All processes have come to the barrier and are gone: from here on the new plan.
    /// Returns the barrier to go on from.
    pub(crate) fn exchange(&mut self, barrier: u64) -> Result<Option<u64>, String> {
        let Some(Swap { asker, request, phase: Phase::Draining(plan) }) = self.swap.take() else {
            return Ok(Some(barrier));
        };
        let whole = self.last_barrier()?;
        if whole != Some(barrier) {
            self.control.answer(asker, &Answer::Refused(vec![format!("a state of barrier {barrier} is torn")]));
            return Ok(whole);
        }
        let of = |name: Option<&str>| name.and_then(|name| self.health.get(name)).cloned().unwrap_or_default();
        let source: Health = of(self.plan.stages.first().map(|stage| &*stage.name));
        let sink: Health = of(self.plan.stages.last().map(|stage| &*stage.name));
        let drive_time = source.drive_time.unwrap_or_default();
        let back = request.back.then(|| format!("{} back to the launch file", request.stage));
        let swapped = Swapped {
            stage: request.stage.clone(),
            barrier,
            ticks: source.ticks,
            drive_time,
            drive_s: drive_time.saturating_sub(source.drive_begin.unwrap_or(drive_time)) as f64 * 1e-9,
            changes: back.into_iter().chain(changes(&request)).collect(),
            state_bytes: self.folder.state_bytes(barrier, &request.stage),
            seconds_without_output: None,
            undone: None,
        };
        // Written before anything is started: a successor must know that states behind the barrier are not to be trusted.
        self.record.trying = Some(Trying { barrier, overrides: self.record.overrides_with(&request) });
        self.folder.write_swaps(&self.record)?;
        // What lies before the barrier is the old plan's: a fall back to it would do it again with the new one.
        self.folder.forget_before(barrier);
        let old = Some(Box::new(std::mem::replace(&mut self.plan, *plan)));
        self.control.working(asker, "starting from the barrier");
        let phase = Phase::Settling { old, swapped: Box::new(swapped), last_tick_nanos: sink.last_tick_nanos };
        self.swap = Some(Swap { asker, request, phase });
        Ok(Some(barrier))
    }

    /// If the attempt to swap has failed: the barrier from which the run goes on as before it.
    pub(crate) fn undo_swap(&mut self, ending: &Result<Ending, String>) -> Result<Option<u64>, String> {
        let Some(Swap { asker, phase: Phase::Settling { old, swapped, .. }, .. }) = &mut self.swap else {
            return Ok(None);
        };
        let reason = match ending {
            Ok(Ending::Failed(fault, last_words)) => {
                let head = format!("[{}] {}", fault.stage, fault.text);
                let words = last_words.iter().map(|line| format!("[{}] | {line}", fault.stage));
                std::iter::once(head).chain(words).collect::<Vec<_>>().join("\n")
            }
            Err(text) => text.clone(),
            Ok(_) => return Ok(None),
        };
        let Some(old) = old.take() else { return Ok(None) };
        self.screen.say(&format!("the swap of [{}] is undone: {reason}", swapped.stage));
        self.control.working(*asker, "undoing the swap");
        swapped.undone = Some(reason);
        self.plan = *old;
        self.record.trying = None;
        self.folder.write_swaps(&self.record)?;
        Ok(Some(swapped.barrier))
    }

    fn settle_swap(&mut self, asker: AskerId, swapped: Swapped) -> Result<(), String> {
        self.record.settle(swapped.clone());
        self.folder.write_swaps(&self.record)?;
        match (&swapped.undone, swapped.seconds_without_output) {
            (Some(_), Some(seconds)) => self.screen.say(&format!("as before the swap: {seconds:.2} s without output")),
            (Some(_), None) => {}
            (None, _) => self.screen.say(&swapped.to_string()),
        }
        self.control.answer(asker, &Answer::Swapped(swapped));
        Ok(())
    }

    /// The run is over: what is still in the air did not come to be. `run/swaps.json` keeps saying that it is being tried, so
    /// that who resumes the run goes back to its barrier.
    pub(crate) fn close_swap(&mut self) {
        if let Some(Swap { asker, phase: Phase::Settling { mut swapped, .. }, .. }) = self.swap.take() {
            swapped.undone.get_or_insert_with(|| "the run ended before the first tick with it".to_owned());
            self.record.swaps.push((*swapped).clone());
            self.control.answer(asker, &Answer::Swapped(*swapped));
        }
    }

    /// What earlier supervisors of this run have swapped holds; what they were at is undone.
    pub(crate) fn take_up_swaps(&mut self) -> Result<(), String> {
        self.record = self.folder.read_swaps()?;
        if let Some(trying) = self.record.trying.take() {
            self.folder.forget_after(Some(trying.barrier))?;
            self.folder.write_swaps(&self.record)?;
        }
        if self.record.overrides.is_empty() {
            return Ok(());
        }
        let overrides = [&self.plan.overrides[..], &self.record.overrides].concat();
        let (copy, selection) = (self.folder.launch_copy(), self.plan.selection.clone());
        let plan = check::plan_as(&copy, &self.plan.launch_file, &overrides, &selection).map_err(|faults| {
            format!("the run was swapped, and what was swapped in does not fit any more:\n{}", faults.join("\n"))
        })?;
        let context = std::mem::replace(&mut self.plan, plan).context;
        self.plan.context = context;
        Ok(())
    }
}

/// The barrier behind which the source pauses, once all have saved their states there: then nothing is on the way.
fn paused_at(processes: &[StageProcess]) -> Option<u64> {
    let source = processes.first().filter(|source| source.health.activity == Activity::Paused)?;
    let barrier = source.health.barrier;
    processes.iter().all(|process| process.health.barrier == barrier).then_some(barrier)
}
