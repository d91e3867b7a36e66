//! Replaces a stage of a running pipeline: check, drain to a barrier, try, then complete or undo. The reasons are in
//! the documentation of swaps.

mod compatibility;
mod refusal;

pub use refusal::SwapRefusal;

use crate::active_run::ActiveRun;
use crate::check;
use crate::control::{ClientId, Control};
use crate::identity::Files;
use crate::plan::Plan;
use crate::run_folder::RunFolderError;
use crate::stage_process::StageProcess;
use crate::swap_record::{SwapRecord, Trial};
use compatibility::incompatibilities;
use run::Change;
use run::control::{Answer, SwapRequest, Swapped};
use run::health::{Activity, Health};
use settings::nearest_key;
use std::collections::BTreeMap;
use std::thread::JoinHandle;

/// An error that ends a run with swaps.
#[derive(Debug, thiserror::Error)]
pub enum SwapError {
    /// States or the record of swaps failed.
    #[error(transparent)]
    Folder(#[from] RunFolderError),
    /// The states before a swap belong to the old plan, so the run cannot continue from them.
    #[error("no complete barrier since the swap of {stage} at barrier {barrier}; start a new run")]
    NoBarrierSince {
        /// Table of the swapped stage.
        stage: String,
        /// Barrier of the swap.
        barrier: u64,
    },
    /// The swapped programs or settings of a resumed run have changed.
    #[error("the swaps of this run are no longer valid:\n{0}")]
    NoLongerValid(String),
}

/// The swaps of a run.
#[derive(Default)]
pub struct Swaps {
    under_way: Option<Swap>,
    record: SwapRecord,
}

struct Swap {
    client: ClientId,
    request: SwapRequest,
    phase: Phase,
}

enum Phase {
    /// A thread checks the new plan; the run does not wait for it.
    Checking(JoinHandle<Result<Plan, check::Refusal>>),
    /// The source pauses after a barrier, and all other stages reach it.
    Draining(Box<Plan>),
    /// All stages were restarted from the barrier, and the sink has not finished a tick yet.
    Trying {
        /// The plan before the swap; `None` if the run uses it again.
        old: Option<Box<Plan>>,
        swapped: Box<Swapped>,
        /// Last tick of the sink before the swap.
        last_tick_nanos: Option<u64>,
    },
}

impl Swaps {
    /// Starts to check a requested swap.
    pub fn begin(
        &mut self,
        client: ClientId,
        request: SwapRequest,
        run: &ActiveRun,
        is_ending: bool,
    ) -> Result<(), SwapRefusal> {
        if is_ending {
            return Err(SwapRefusal::Draining);
        }
        if let Some(other) = &self.under_way {
            return Err(SwapRefusal::UnderWay { stage: other.request.stage.clone() });
        }
        if run.is_live() {
            return Err(SwapRefusal::Live);
        }
        let plan = &run.plan;
        if !plan.selection.recorded.is_empty() {
            return Err(SwapRefusal::Recorded);
        }
        let names = plan.stages.iter().map(|stage| stage.name.as_str());
        if names.clone().all(|name| name != request.stage) {
            let hint = nearest_key(&request.stage, names).replace("unknown key", "no such stage in this run");
            return Err(SwapRefusal::UnknownStage { stage: request.stage, hint });
        }
        if let Some(change) = request.changes.iter().find(|change| change.table() != request.stage) {
            return Err(SwapRefusal::OtherTable { stage: request.stage, change: change.clone() });
        }
        let changes = self.changes_with(plan, &self.record.changes_with(&request));
        let copy = run.folder.launch_copy();
        let launch_file = plan.launch_file.clone();
        let selection = plan.selection.clone();
        let thread = std::thread::Builder::new().name("check".to_owned());
        let checking = thread.spawn(move || check::plan_as(&copy, &launch_file, &changes, &selection));
        let phase = Phase::Checking(checking.map_err(SwapRefusal::Thread)?);
        self.under_way = Some(Swap { client, request, phase });
        Ok(())
    }

    /// The changes of the command line, followed by `swapped` instead of the changes of completed swaps.
    fn changes_with(&self, plan: &Plan, swapped: &[Change]) -> Vec<Change> {
        let n_of_command_line = plan.changes.len().saturating_sub(self.record.changes.len());
        [&plan.changes[..n_of_command_line], swapped].concat()
    }

    /// Whether the pipeline waits for a swap, so that faster polling shortens its pause.
    pub fn is_waited_for(&self) -> bool {
        self.under_way.as_ref().is_some_and(|swap| !matches!(swap.phase, Phase::Checking(_)))
    }

    /// The stage that the next attempt replaces: its files may change.
    pub fn replaced_stage(&self) -> Option<&str> {
        let swap = self.under_way.as_ref().filter(|swap| matches!(swap.phase, Phase::Trying { .. }))?;
        Some(&swap.request.stage)
    }

    /// Whether the source must pause after its next barrier.
    pub fn is_draining(&self) -> bool {
        self.under_way.as_ref().is_some_and(|swap| matches!(swap.phase, Phase::Draining(_)))
    }

    /// Advances the active swap by one phase, if it is due. Returns the barrier that all stages have reached for the
    /// swap.
    pub fn advance(
        &mut self,
        processes: &[StageProcess],
        run: &ActiveRun,
        control: &mut Control,
        is_ending: bool,
    ) -> Result<Option<u64>, SwapError> {
        let Some(Swap { client, request, phase }) = self.under_way.take() else { return Ok(None) };
        let mut arrived = None;
        let phase = match phase {
            Phase::Checking(thread) if !thread.is_finished() => Some(Phase::Checking(thread)),
            Phase::Checking(thread) => {
                let checked = thread.join().map_err(|_| vec!["the check panicked".to_owned()]);
                let checked = checked.and_then(|checked| checked.map_err(|refusal| refusal.problems));
                match checked.and_then(|plan| compatible(plan, &run.plan, &request.stage)) {
                    Ok(plan) => {
                        control.working(client, "draining to a barrier");
                        Some(Phase::Draining(Box::new(plan)))
                    }
                    Err(reasons) => {
                        control.answer(client, &Answer::Refused(reasons));
                        None
                    }
                }
            }
            Phase::Draining(_) if is_ending => {
                control.answer(client, &Answer::Refused(vec![SwapRefusal::Draining.to_string()]));
                None
            }
            Phase::Draining(plan) => {
                arrived = paused_at(processes);
                Some(Phase::Draining(plan))
            }
            Phase::Trying { old, mut swapped, last_tick_nanos } => {
                match processes.last().and_then(|sink| sink.health.first_tick_nanos) {
                    None => Some(Phase::Trying { old, swapped, last_tick_nanos }),
                    Some(first) => {
                        swapped.seconds_without_output =
                            last_tick_nanos.map(|last| first.saturating_sub(last) as f64 * 1e-9);
                        self.complete(client, *swapped, run, control)?;
                        None
                    }
                }
            }
        };
        self.under_way = phase.map(|phase| Swap { client, request, phase });
        Ok(arrived)
    }

    /// Applies the new plan after all processes have reached the barrier and ended. Returns the barrier to continue
    /// from.
    pub fn exchange(
        &mut self,
        barrier: u64,
        health: &BTreeMap<String, Health>,
        run: &mut ActiveRun,
        control: &mut Control,
    ) -> Result<Option<u64>, SwapError> {
        let Some(Swap { client, request, phase: Phase::Draining(plan) }) = self.under_way.take() else {
            return Ok(Some(barrier));
        };
        let complete = self.last_barrier(run)?;
        if complete != Some(barrier) {
            control.answer(client, &Answer::Refused(vec![format!("a state at barrier {barrier} is damaged")]));
            return Ok(complete);
        }
        let of = |name: Option<&str>| name.and_then(|name| health.get(name)).cloned().unwrap_or_default();
        let source: Health = of(run.plan.stages.first().map(|stage| &*stage.name));
        let sink: Health = of(run.plan.stages.last().map(|stage| &*stage.name));
        let drive_time = source.drive_time.unwrap_or_default();
        let back = request.back.then(|| format!("{} back to the launch file", request.stage));
        let swapped = Swapped {
            stage: request.stage.clone(),
            barrier,
            ticks: source.ticks,
            drive_time,
            drive_s: drive_time.saturating_sub(source.drive_begin.unwrap_or(drive_time)) as f64 * 1e-9,
            changes: back.into_iter().chain(request.changes.iter().map(Change::to_string)).collect(),
            state_bytes: run.folder.states().bytes(barrier, &request.stage),
            seconds_without_output: None,
            undone: None,
        };
        // Written before any process starts: a later supervisor must find that states after the barrier are on trial.
        let files = Files::read(&plan, &run.files).map_err(RunFolderError::from)?;
        self.record.trial = Some(Trial { barrier, changes: self.record.changes_with(&request), files });
        run.folder.write_swaps(&self.record)?;
        // States before the barrier belong to the old plan: the run must not fall back to them with the new one.
        run.folder.states().remove_before(barrier);
        let old = Some(Box::new(std::mem::replace(&mut run.plan, *plan)));
        control.working(client, "starting from the barrier");
        let phase = Phase::Trying { old, swapped: Box::new(swapped), last_tick_nanos: sink.last_tick_nanos };
        self.under_way = Some(Swap { client, request, phase });
        Ok(Some(barrier))
    }

    /// Handles the failure of an attempt, with its reason. If it was the trial of a swap, restores the old plan and
    /// returns the barrier to continue from.
    pub fn undo(
        &mut self,
        reason: String,
        run: &mut ActiveRun,
        control: &mut Control,
    ) -> Result<Option<u64>, SwapError> {
        let Some(Swap { client, phase: Phase::Trying { old, swapped, .. }, .. }) = &mut self.under_way else {
            return Ok(None);
        };
        let Some(old) = old.take() else { return Ok(None) };
        tracing::warn!(stage = swapped.stage, "the swap of [{}] is undone: {reason}", swapped.stage);
        control.working(*client, "undoing the swap");
        swapped.undone = Some(reason);
        run.plan = *old;
        self.record.trial = None;
        run.folder.write_swaps(&self.record)?;
        Ok(Some(swapped.barrier))
    }

    /// Handles the sink's first finished tick: the swap is completed, or the run uses the old plan again.
    fn complete(
        &mut self,
        client: ClientId,
        swapped: Swapped,
        run: &ActiveRun,
        control: &mut Control,
    ) -> Result<(), SwapError> {
        self.record.complete(swapped.clone());
        run.folder.write_swaps(&self.record)?;
        match (&swapped.undone, swapped.seconds_without_output) {
            (Some(_), Some(seconds)) => {
                tracing::info!("the swap has been undone, after {seconds:.2} s without output");
            }
            (Some(_), None) => {}
            (None, _) => tracing::info!(stage = swapped.stage, "{swapped}"),
        }
        control.answer(client, &Answer::Swapped(swapped));
        Ok(())
    }

    /// Ends the run: a swap on trial is not completed. `run/swaps.json` keeps the trial, so that a resumed run returns
    /// to its barrier.
    pub fn close(&mut self, control: &mut Control) {
        if let Some(Swap { client, phase: Phase::Trying { mut swapped, .. }, .. }) = self.under_way.take() {
            swapped.undone.get_or_insert_with(|| "the run ended before its first tick".to_owned());
            self.record.swaps.push((*swapped).clone());
            control.answer(client, &Answer::Swapped(*swapped));
        }
    }

    /// Restores the swaps of a resumed run: completed swaps of earlier supervisors remain, a swap on trial is undone.
    pub fn restore(&mut self, run: &mut ActiveRun) -> Result<(), SwapError> {
        self.record = run.folder.read_swaps()?;
        if let Some(trial) = self.record.trial.take() {
            run.folder.states().remove_after(Some(trial.barrier))?;
            run.folder.write_swaps(&self.record)?;
        }
        if self.record.changes.is_empty() {
            return Ok(());
        }
        let changes = [&run.plan.changes[..], &self.record.changes].concat();
        let copy = run.folder.launch_copy();
        let selection = run.plan.selection.clone();
        let plan = check::plan_as(&copy, &run.plan.launch_file, &changes, &selection)
            .map_err(|refusal| SwapError::NoLongerValid(refusal.problems.join("\n")))?;
        let context = std::mem::replace(&mut run.plan, plan).context;
        run.plan.context = context;
        let files = Files::read(&run.plan, &run.files).map_err(RunFolderError::from)?;
        let before = self.record.files.clone().unwrap_or_default();
        Ok(run.folder.refuse_changed_files(&files, &before, None)?)
    }

    /// The last complete barrier. States before a completed swap belong to the old plan, so the run cannot continue
    /// from them.
    pub fn last_barrier(&self, run: &ActiveRun) -> Result<Option<u64>, SwapError> {
        let barrier = run.folder.states().last_complete_barrier(&run.plan.stages);
        match self.record.swaps.iter().rfind(|swap| swap.undone.is_none()) {
            Some(swap) if barrier < Some(swap.barrier) => {
                Err(SwapError::NoBarrierSince { stage: swap.stage.clone(), barrier: swap.barrier })
            }
            _ => Ok(barrier),
        }
    }

    /// All swaps of the run in their order, for its summary.
    pub fn take_all(&mut self) -> Vec<Swapped> {
        std::mem::take(&mut self.record.swaps)
    }
}

/// The plan, if it is the plan of this run except for the stage.
fn compatible(mut plan: Plan, running: &Plan, stage: &str) -> Result<Plan, Vec<String>> {
    plan.context = running.context.clone();
    let reasons = incompatibilities(&running.stages, &plan.stages, stage);
    if reasons.is_empty() { Ok(plan) } else { Err(reasons) }
}

/// The barrier after which the source pauses, once all stages have saved their states there: no data is in flight.
fn paused_at(processes: &[StageProcess]) -> Option<u64> {
    let source = processes.first().filter(|source| source.health.activity == Activity::Paused)?;
    let barrier = source.health.barrier;
    processes.iter().all(|process| process.health.barrier == barrier).then_some(barrier)
}
