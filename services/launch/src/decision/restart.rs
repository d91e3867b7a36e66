//! Restart or give up. Part of [`super::decide`].

use super::fault::Fault;
use super::policy::Policy;
use std::fmt;
use std::time::Duration;

/// The longest pause before a restart.
const MAX_DELAY: Duration = Duration::from_secs(30);

/// Live: a process that ran for this long was healthy, so its end does not repeat the fault before it.
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
    /// The budget when all stages have reached `barrier`: a new barrier resets it.
    fn at(self, barrier: Option<u64>) -> Self {
        if barrier > self.barrier { Self { barrier, used: 0 } } else { self }
    }
}

/// Why a run ends as failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GiveUp {
    /// The operator has asked for the end, so nothing is restarted.
    EndRequested,
    /// The fault would occur again: wrong configuration, full disk.
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

/// Live: a stage failed while the others continue. The pause before its restart, and the number of the restart.
pub(super) fn of_stage(
    fault: &Fault,
    is_ending: bool,
    restarts: u32,
    ran_for: Option<Duration>,
    policy: &Policy,
) -> Result<(Duration, u32), GiveUp> {
    let restarts = if ran_for.is_some_and(|ran_for| ran_for > HEALTHY_AFTER) { 0 } else { restarts };
    if is_ending {
        Err(GiveUp::EndRequested)
    } else if !fault.may_restart() {
        Err(GiveUp::RestartCannotHelp)
    } else if restarts >= policy.restarts {
        Err(GiveUp::NoProgress(restarts))
    } else {
        Ok((backoff(policy.restart_delay_s, restarts), restarts + 1))
    }
}

/// Offline: the attempt has ended. The pause before the restart of the run, and the budget after it.
pub(super) fn of_run(
    fault: &Fault,
    is_ending: bool,
    barrier: Option<u64>,
    budget: RestartBudget,
    is_memory_low: bool,
    policy: &Policy,
) -> Result<(Duration, RestartBudget), GiveUp> {
    let budget = budget.at(barrier);
    if is_ending {
        Err(GiveUp::EndRequested)
    } else if is_memory_low {
        Err(GiveUp::MemoryLow)
    } else if !fault.may_restart() {
        Err(GiveUp::RestartCannotHelp)
    } else if budget.used >= policy.restarts {
        Err(GiveUp::NoProgress(budget.used))
    } else {
        let delay = backoff(policy.restart_delay_s, budget.used);
        Ok((delay, RestartBudget { used: budget.used + 1, ..budget }))
    }
}

/// The pause before restart number `n`, counted from 0: doubled each time.
fn backoff(first_delay_s: f64, n: u32) -> Duration {
    let factor = 1_u32.checked_shl(n).unwrap_or(u32::MAX);
    Duration::from_millis((first_delay_s * 1000.0) as u64).saturating_mul(factor).min(MAX_DELAY)
}
