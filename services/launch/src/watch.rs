//! Telling apart what can go wrong with a stage: it ended, it hangs, it stalls, or the whole run stands still.

use crate::child::StageProcess;
use crate::manifest::Run;
use crate::plan::PlannedStage;
use stage::exit;
use stage::health::Activity;
use std::time::{Duration, Instant};

/// What is wrong, in words, and whether a restart may help.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Table of the stage.
    pub stage: String,
    /// Kind and circumstances.
    pub text: String,
    /// A wrong configuration stays wrong.
    pub may_restart: bool,
}

/// The first fault in the order of the dataflow: what fails upstream is the cause of what fails downstream. `now` is when the
/// processes began to be observed: what holds the supervisor up since makes nobody look silent.
pub fn first_fault(processes: &[StageProcess], stages: &[PlannedStage], run: &Run, now: Instant) -> Option<Fault> {
    let connecting = connecting_since(processes);
    let of_stage = |(process, stage)| fault(process, stage, run, connecting, now);
    let by_stage = processes.iter().zip(stages).find_map(of_stage);
    // Live, a street without packets is no fault.
    by_stage.or_else(|| if run.mode == "live" { None } else { standstill(processes, run, now) })
}

/// Since when those that connect have only each other to wait for. `None` while one still starts: that one has its own limit.
fn connecting_since(processes: &[StageProcess]) -> Option<Instant> {
    let running = || processes.iter().filter(|process| process.status.is_none());
    if running().any(|process| process.health.activity == Activity::Starting) {
        return None;
    }
    let connecting = running().filter(|process| matches!(process.health.activity, Activity::Connecting(_)));
    connecting.map(|process| process.last_progress).max()
}

fn fault(
    process: &StageProcess,
    stage: &PlannedStage,
    run: &Run,
    connecting: Option<Instant>,
    now: Instant,
) -> Option<Fault> {
    if process.is_down {
        return None;
    }
    let fault = |text: String, may_restart| Some(Fault { stage: process.name.clone(), text, may_restart });
    if let Some(status) = process.status {
        return match status.code() {
            Some(0) if process.health.activity == Activity::Done => None,
            Some(0) => fault("exit: ended with exit code 0 before its work was done".to_owned(), true),
            code => fault(
                format!("exit: {}", process.ending()),
                code != Some(i32::from(exit::CONFIGURATION)) && code != Some(i32::from(exit::USAGE)),
            ),
        };
    }
    let silent = now - process.last_beat;
    if silent.as_secs_f64() > run.hang_s {
        return fault(format!("hang: no heartbeat for {:.1} s", silent.as_secs_f64()), true);
    }
    let limit = if stage.table.stall_s > 0.0 { stage.table.stall_s } else { run.stall_s };
    let is_connecting = matches!(process.health.activity, Activity::Connecting(_));
    let since = if is_connecting { connecting? } else { process.last_progress };
    let stuck = (now - since).as_secs_f64();
    if stuck > limit {
        let ticks = process.health.ticks;
        match &process.health.activity {
            Activity::Working => return fault(format!("stall: {stuck:.1} s in the step of tick {ticks}"), true),
            Activity::Starting => return fault(format!("stall: {stuck:.1} s in its start"), true),
            Activity::Saving => return fault(format!("stall: {stuck:.1} s in saving its state"), true),
            Activity::Connecting(topic) => {
                return fault(format!("stall: {stuck:.1} s waiting for topic {topic}"), true);
            }
            Activity::Ready
            | Activity::Waiting(_)
            | Activity::Blocked(_)
            | Activity::Paused
            | Activity::Draining
            | Activity::Done => {}
        }
    }
    None
}

/// Everybody waits for somebody and nothing moves. A stage that is at something has its own limit (see [`fault`]).
fn standstill(processes: &[StageProcess], run: &Run, now: Instant) -> Option<Fault> {
    let running: Vec<&StageProcess> = processes.iter().filter(|process| process.status.is_none()).collect();
    if running.iter().any(|process| is_at_something(&process.health.activity)) {
        return None;
    }
    let last = running.iter().map(|process| process.last_progress).max()?;
    let still: Duration = now - last;
    if still.as_secs_f64() <= run.stall_s {
        return None;
    }
    let activities: Vec<String> = running.iter().map(|p| format!("{}: {:?}", p.name, p.health.activity)).collect();
    let text = format!("stall: nothing has moved for {:.1} s ({})", still.as_secs_f64(), activities.join("; "));
    Some(Fault { stage: running.first()?.name.clone(), text, may_restart: true })
}

fn is_at_something(activity: &Activity) -> bool {
    matches!(activity, Activity::Starting | Activity::Connecting(_) | Activity::Working | Activity::Saving)
}
