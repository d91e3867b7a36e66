//! Exit, hang and stall: finds the faulty stage.

use super::cause::Cause;
use super::policy::Policy;
use run::exit;
use run::health::Activity;
use std::fmt;
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::time::Duration;

/// Exit code of a Rust program that panicked.
const PANIC: i32 = 101;

/// Signals and their usual reasons.
const SIGNALS: [(i32, &str); 7] = [
    (4, "SIGILL: this processor does not support an instruction of the program"),
    (6, "SIGABRT: an allocation failed, or a panic occurred within a panic"),
    (7, "SIGBUS: mapped memory was not available; shared memory may be full"),
    (9, "SIGKILL: by another process, or by the kernel for lack of memory"),
    (11, "SIGSEGV: invalid memory access"),
    (24, "SIGXCPU: its CPU time reached the limit (ulimit -t)"),
    (25, "SIGXFSZ: a file reached the largest size allowed (ulimit -f)"),
];

/// The observed state of a stage.
#[derive(Clone, Debug)]
pub struct ObservedStage {
    /// Its table in the launch file.
    pub name: String,
    /// Exit of its process. `None`: the process runs.
    pub exit: Option<Exit>,
    /// Its activity in the last heartbeat.
    pub activity: Activity,
    /// Ticks that it has finished.
    pub ticks: u64,
    /// Time at which its last heartbeat was received, or its process was started.
    pub last_heartbeat: Duration,
    /// Time at which its progress or its activity last changed.
    pub last_progress: Duration,
    /// Time since its last heartbeat in which it waited for a processor: it does not count as silence.
    pub starved_since_heartbeat: Duration,
    /// Time since its last progress in which it waited for a processor: it does not count as a stall.
    pub starved_since_progress: Duration,
    /// Error of reading its last heartbeat.
    pub heartbeat_error: Option<String>,
    /// Live: the stage has failed, and its restart is due later.
    pub awaits_restart: bool,
}

/// Exit of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// An exit with this code.
    Code(i32),
    /// Killed by this signal.
    Signal(i32),
}

impl From<ExitStatus> for Exit {
    fn from(status: ExitStatus) -> Self {
        match (status.code(), status.signal()) {
            (Some(code), _) => Self::Code(code),
            // A process that was waited for has one of the two.
            (None, signal) => Self::Signal(signal.unwrap_or_default()),
        }
    }
}

impl Exit {
    /// Whether a restart can help. Configuration and usage errors recur after a restart.
    fn may_restart(self) -> bool {
        self != Self::Code(exit::CONFIGURATION.into()) && self != Self::Code(exit::USAGE.into())
    }
}

impl fmt::Display for Exit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Code(PANIC) => write!(f, "panicked (exit code {PANIC})"),
            Self::Code(code) if code == i32::from(exit::CONFIGURATION) => {
                write!(f, "refused its configuration (exit code {code})")
            }
            Self::Code(code) => write!(f, "ended with exit code {code}"),
            Self::Signal(signal) => match SIGNALS.iter().find(|(number, _)| *number == signal) {
                Some((_, reason)) => write!(f, "was killed by {reason}"),
                None => write!(f, "was killed by signal {signal}"),
            },
        }
    }
}

/// A fault of a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Table of the stage.
    pub stage: String,
    /// Kind of the fault.
    pub kind: FaultKind,
    /// The exhausted resource that caused it.
    pub cause: Option<Cause>,
}

/// A duration that counts for a limit, and the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counted {
    /// Time that counts, s.
    pub seconds: f64,
    /// Further time, in which the stage waited for a processor, s.
    pub starved_s: f64,
}

impl Counted {
    fn new(at: Duration, since: Duration, starved: Duration) -> Self {
        let seconds = at.saturating_sub(since).saturating_sub(starved).as_secs_f64();
        Self { seconds, starved_s: starved.as_secs_f64() }
    }
}

impl fmt::Display for Counted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} s", self.seconds)?;
        if self.starved_s >= 1.0 {
            write!(f, " (without {:.1} s in which other programs had the processors)", self.starved_s)?;
        }
        Ok(())
    }
}

/// Kind of a stage's fault.
#[derive(Clone, Debug, PartialEq)]
pub enum FaultKind {
    /// Its process ended with an error.
    Exit(Exit),
    /// Its process ended with code 0 before its work was done.
    EarlyExit,
    /// No heartbeat.
    Hang {
        /// Duration without the time in which the stage lacked a processor.
        silence: Counted,
    },
    /// Heartbeats, but no progress.
    Stall {
        /// Duration without the time in which the stage lacked a processor.
        stall: Counted,
        /// Activity during the stall.
        activity: Activity,
        /// Ticks finished before the stall.
        ticks: u64,
    },
    /// Every stage waits for another one, and no stage makes progress.
    Deadlock {
        /// Duration without the time in which the last stage with progress lacked a processor.
        pause: Counted,
        /// Activity of each stage.
        activities: String,
    },
    /// Its heartbeat cannot be read.
    UnreadableHeartbeat(String),
}

impl FaultKind {
    /// One word, for programs that read the events.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Exit(_) | Self::EarlyExit => "exit",
            Self::Hang { .. } => "hang",
            Self::Stall { .. } | Self::Deadlock { .. } => "stall",
            Self::UnreadableHeartbeat(_) => "heartbeat",
        }
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.name())?;
        match self {
            Self::Exit(exit) => write!(f, "{exit}"),
            Self::EarlyExit => write!(f, "ended with exit code 0 before its work was done"),
            Self::Hang { silence } => write!(f, "no heartbeat for {silence}"),
            Self::Stall { stall, activity, ticks } => match activity {
                Activity::Working => write!(f, "{stall} in the step of tick {ticks}"),
                Activity::Starting => write!(f, "{stall} in its start"),
                Activity::Saving => write!(f, "{stall} while saving its state"),
                Activity::Connecting(topic) => write!(f, "{stall} waiting for topic {topic} to open"),
                other => write!(f, "{stall} in {other:?}"),
            },
            Self::Deadlock { pause, activities } => {
                write!(f, "no stage has made progress for {pause} ({activities})")
            }
            Self::UnreadableHeartbeat(error) => write!(f, "cannot be read: {error}"),
        }
    }
}

impl Fault {
    /// Whether a restart can help.
    pub fn may_restart(&self) -> bool {
        let by_exit = if let FaultKind::Exit(exit) = self.kind { exit.may_restart() } else { true };
        by_exit && self.cause.as_ref().is_none_or(Cause::may_restart)
    }

    /// The signal that ended the stage.
    pub fn signal(&self) -> Option<i32> {
        if let FaultKind::Exit(Exit::Signal(signal)) = self.kind { Some(signal) } else { None }
    }

    /// The text without the stage's name.
    pub fn text(&self) -> String {
        match &self.cause {
            None => self.kind.to_string(),
            Some(cause) => format!("{}; {cause}", self.kind),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}] {}", self.stage, self.text())
    }
}

/// The judgment of the stages of an attempt.
#[derive(Clone, Debug, PartialEq)]
pub enum Judgment {
    /// No fault: keep running.
    Continue,
    /// All stages have finished.
    Finish,
    /// This stage is to blame: find the cause, then call [`super::restart_stage`].
    Blame(Fault),
}

/// Judges the stages of an attempt, given in dataflow order. `at`: time at which the supervisor started to observe
/// them. The time it spends afterwards does not count as missed heartbeats.
pub fn judge(at: Duration, stages: &[ObservedStage], policy: &Policy) -> Judgment {
    match first_fault(at, stages, policy) {
        Some(fault) => Judgment::Blame(fault),
        None if stages.iter().all(|stage| stage.exit.is_some() && !stage.awaits_restart) => Judgment::Finish,
        None => Judgment::Continue,
    }
}

/// The first faulty stage in dataflow order: an upstream fault causes the faults downstream of it.
fn first_fault(at: Duration, stages: &[ObservedStage], policy: &Policy) -> Option<Fault> {
    let connecting_since = connecting_since(stages);
    let of_stage = |stage: &ObservedStage| {
        let kind = fault(at, stage, connecting_since, policy)?;
        Some(Fault { stage: stage.name.clone(), kind, cause: None })
    };
    stages.iter().find_map(of_stage).or_else(|| deadlock(at, stages, policy)).or_else(|| unreadable_heartbeat(stages))
}

/// Time since which the connecting stages wait only for each other. `None` while another stage still starts: its own
/// limit counts.
fn connecting_since(stages: &[ObservedStage]) -> Option<Duration> {
    let running = || stages.iter().filter(|stage| stage.exit.is_none());
    if running().any(|stage| stage.activity == Activity::Starting) {
        return None;
    }
    let connecting = running().filter(|stage| matches!(stage.activity, Activity::Connecting(_)));
    connecting.map(|stage| stage.last_progress).max()
}

fn fault(
    at: Duration,
    stage: &ObservedStage,
    connecting_since: Option<Duration>,
    policy: &Policy,
) -> Option<FaultKind> {
    if stage.awaits_restart {
        return None;
    }
    match stage.exit {
        Some(Exit::Code(0)) if stage.activity == Activity::Done => return None,
        Some(Exit::Code(0)) => return Some(FaultKind::EarlyExit),
        Some(exit) => return Some(FaultKind::Exit(exit)),
        None => {}
    }
    let silence = Counted::new(at, stage.last_heartbeat, stage.starved_since_heartbeat);
    if silence.seconds > policy.hang_s {
        return Some(FaultKind::Hang { silence });
    }
    let since = match stage.activity {
        Activity::Connecting(_) => connecting_since?,
        Activity::Working | Activity::Starting | Activity::Saving => stage.last_progress,
        // A waiting stage is not to blame for the delay of other stages; see `deadlock`.
        Activity::Ready
        | Activity::Waiting(_)
        | Activity::Blocked(_)
        | Activity::Paused
        | Activity::Draining
        | Activity::Done => return None,
    };
    let stall = Counted::new(at, since, stage.starved_since_progress);
    let activity = stage.activity.clone();
    let ticks = stage.ticks;
    (stall.seconds > policy.stall_limit_s(&stage.name)).then_some(FaultKind::Stall { stall, activity, ticks })
}

/// Every stage waits for another one and no stage makes progress. A stage that works has its own limit (see [`fault`]);
/// live, all stages may wait for a sensor.
fn deadlock(at: Duration, stages: &[ObservedStage], policy: &Policy) -> Option<Fault> {
    let running: Vec<&ObservedStage> = stages.iter().filter(|stage| stage.exit.is_none()).collect();
    if policy.is_live || running.iter().any(|stage| is_active(&stage.activity)) {
        return None;
    }
    let counted = running.iter().map(|stage| Counted::new(at, stage.last_progress, stage.starved_since_progress));
    let pause = counted.min_by(|a, b| a.seconds.total_cmp(&b.seconds))?;
    if pause.seconds <= policy.stall_s {
        return None;
    }
    let activities = running.iter().map(|stage| format!("{}: {:?}", stage.name, stage.activity));
    let activities = activities.collect::<Vec<_>>().join("; ");
    let kind = FaultKind::Deadlock { pause, activities };
    Some(Fault { stage: running.first()?.name.clone(), kind, cause: None })
}

fn is_active(activity: &Activity) -> bool {
    matches!(activity, Activity::Starting | Activity::Connecting(_) | Activity::Working | Activity::Saving)
}

/// An unreadable heartbeat. A stage that is killed while it connects may leave one: a fault of the stage, not of the
/// run.
fn unreadable_heartbeat(stages: &[ObservedStage]) -> Option<Fault> {
    stages.iter().find_map(|stage| {
        let kind = FaultKind::UnreadableHeartbeat(stage.heartbeat_error.clone()?);
        Some(Fault { stage: stage.name.clone(), kind, cause: None })
    })
}
