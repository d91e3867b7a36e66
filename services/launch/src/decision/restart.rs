//! Restart or give up.

use super::fault::Fault;
use super::policy::Policy;
use std::fmt;
use std::time::Duration;

/// The longest pause before a restart.
const MAX_DELAY: Duration = Duration::from_secs(30);

/// Live: a process that ran for this long was healthy, so its end does not count as a repeated fault.
const HEALTHY_AFTER: Duration = Duration::from_mins(1);

/// Restarts of a run without progress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RestartBudget {
    /// The last barrier that all stages had reached at the last restart.
    pub barrier: Option<u64>,
    /// Restarts since that barrier was reached for the first time.
    pub used: u32,
}

impl RestartBudget {
    /// The budget after all stages have reached `barrier`: a new barrier resets it.
    fn at(self, barrier: Option<u64>) -> Self {
        if barrier > self.barrier { Self { barrier, used: 0 } } else { self }
    }
}

/// The reason why a run ends as failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GiveUp {
    /// The operator has requested the end, so nothing is restarted.
    EndRequested,
    /// The fault would recur: invalid configuration, full disk.
    RestartCannotHelp,
    /// This many restarts brought no progress.
    NoProgress(u32),
    /// Less shared memory is free than a run needs.
    MemoryLow,
}

impl fmt::Display for GiveUp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EndRequested => write!(f, "the end of the run was requested"),
            Self::RestartCannotHelp => write!(f, "a restart cannot remove this fault"),
            Self::NoProgress(restarts) => write!(f, "no progress after {restarts} restarts"),
            Self::MemoryLow => write!(f, "too little shared memory is free"),
        }
    }
}

/// A stage with a fault, while the other stages run.
#[derive(Clone, Copy, Debug)]
pub struct FaultyStage<'a> {
    /// The fault and its cause.
    pub fault: &'a Fault,
    /// The operator requested the end of the run.
    pub is_ending: bool,
    /// Live: restarts of this stage so far without a healthy process between them.
    pub restarts: u32,
    /// Live: running time of the restarted process. `None`: the stage was never restarted.
    pub ran_for: Option<Duration>,
}

/// The decision about a faulty stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StageDecision {
    /// Live: restart the stage alone after a pause; the other stages continue.
    Restart {
        /// The pause.
        delay: Duration,
        /// Number of this restart, counted from the last healthy process.
        restart: u32,
    },
    /// Offline: end all processes of the attempt, then call [`restart_run`].
    EndAttempt,
    /// Live: end the run as failed.
    GiveUp(GiveUp),
}

/// Whether a faulty stage is restarted alone; never offline.
pub fn restart_stage(stage: &FaultyStage<'_>, policy: &Policy) -> StageDecision {
    let FaultyStage { fault, is_ending, restarts, ran_for } = *stage;
    let restarts = if ran_for.is_some_and(|ran_for| ran_for > HEALTHY_AFTER) { 0 } else { restarts };
    if !policy.is_live {
        StageDecision::EndAttempt
    } else if is_ending {
        StageDecision::GiveUp(GiveUp::EndRequested)
    } else if !fault.may_restart() {
        StageDecision::GiveUp(GiveUp::RestartCannotHelp)
    } else if restarts >= policy.restarts {
        StageDecision::GiveUp(GiveUp::NoProgress(restarts))
    } else {
        StageDecision::Restart { delay: backoff(policy.restart_delay_s, restarts), restart: restarts + 1 }
    }
}

/// Offline: an attempt that ended with a fault, after all its processes have ended.
#[derive(Clone, Copy, Debug)]
pub struct FailedAttempt<'a> {
    /// The fault and its cause.
    pub fault: &'a Fault,
    /// The operator requested the end of the run.
    pub is_ending: bool,
    /// Last barrier of which all stages have a valid state.
    pub barrier: Option<u64>,
    /// Restarts used so far.
    pub budget: RestartBudget,
    /// Less shared memory is free than a run needs.
    pub is_memory_low: bool,
}

/// The decision about a failed attempt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RunDecision {
    /// Restart all stages from the last barrier after a pause.
    Restart {
        /// The pause.
        delay: Duration,
        /// The budget after this restart.
        budget: RestartBudget,
    },
    /// End the run as failed.
    GiveUp(GiveUp),
}

/// Whether a run is restarted after a failed attempt.
pub fn restart_run(attempt: &FailedAttempt<'_>, policy: &Policy) -> RunDecision {
    let budget = attempt.budget.at(attempt.barrier);
    if attempt.is_ending {
        RunDecision::GiveUp(GiveUp::EndRequested)
    } else if attempt.is_memory_low {
        RunDecision::GiveUp(GiveUp::MemoryLow)
    } else if !attempt.fault.may_restart() {
        RunDecision::GiveUp(GiveUp::RestartCannotHelp)
    } else if budget.used >= policy.restarts {
        RunDecision::GiveUp(GiveUp::NoProgress(budget.used))
    } else {
        let delay = backoff(policy.restart_delay_s, budget.used);
        RunDecision::Restart { delay, budget: RestartBudget { used: budget.used + 1, ..budget } }
    }
}

/// The pause before restart number `n`, counted from 0: it doubles each time.
fn backoff(first_delay_s: f64, n: u32) -> Duration {
    let factor = 1_u32.checked_shl(n).unwrap_or(u32::MAX);
    Duration::from_millis((first_delay_s * 1000.0) as u64).saturating_mul(factor).min(MAX_DELAY)
}
