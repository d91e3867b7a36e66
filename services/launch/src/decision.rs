//! Supervision's decisions: what the supervisor does about what it observes.
//!
//! [`decide`] is a pure function. It reads no clock and no file, and it starts and kills nothing: [`crate::supervise`]
//! collects observations and carries decisions out.
//!
//! | question | file |
//! |---|---|
//! | When did a stage exit too early, hang or stall? Which stage is to blame? | [`fault`] |
//! | Which exhausted resource caused a fault? | [`cause`] |
//! | Restart, or give up? | [`restart`] |
//! | The limits that a launch file sets | [`policy`] |

pub mod cause;
pub mod fault;
mod policy;
pub mod restart;
#[cfg(test)]
mod tests;

pub use cause::Evidence;
pub use fault::{Fault, ObservedStage};
pub use policy::Policy;
pub use restart::{GiveUp, RestartBudget};

use std::time::Duration;

/// What the supervisor observes. All times are of one monotonic clock.
#[derive(Clone, Copy, Debug)]
pub enum Observation<'a> {
    /// The processes of an attempt.
    Stages {
        /// When the supervisor began to observe the stages. What it does after that takes time, too; that time does not count
        /// as missed heartbeats.
        at: Duration,
        /// The stages in dataflow order.
        stages: &'a [ObservedStage],
    },
    /// A stage has a fault; the other stages still run.
    FaultyStage {
        /// The fault and its cause.
        fault: &'a Fault,
        /// The operator asked for the end of the run.
        is_ending: bool,
        /// Live: restarts of this stage so far without a healthy process between them.
        restarts: u32,
        /// Live: how long the restarted process ran. `None`: the stage was never restarted.
        ran_for: Option<Duration>,
    },
    /// An attempt ended with a fault, and all its processes are gone.
    FailedAttempt {
        /// The fault and its cause.
        fault: &'a Fault,
        /// The operator asked for the end of the run.
        is_ending: bool,
        /// Last barrier of which all stages have a valid state.
        barrier: Option<u64>,
        /// Restarts used so far.
        budget: RestartBudget,
        /// Less shared memory is free than a run needs.
        is_memory_low: bool,
    },
}

/// What the supervisor does.
#[derive(Clone, Debug, PartialEq)]
pub enum Decision {
    /// Keep running.
    Continue,
    /// All stages have finished.
    Finish,
    /// This stage is to blame: find the cause and ask again with [`Observation::FaultyStage`].
    Blame(Fault),
    /// Live: restart the stage alone after a pause; the other stages continue.
    RestartStage {
        /// The pause.
        delay: Duration,
        /// Number of this restart, counted from the last healthy process.
        restart: u32,
    },
    /// End all processes of the attempt, and ask again with [`Observation::FailedAttempt`].
    EndAttempt,
    /// Restart all stages from the last barrier after a pause.
    RestartRun {
        /// The pause.
        delay: Duration,
        /// The budget after this restart.
        budget: RestartBudget,
    },
    /// End the run as failed.
    GiveUp(GiveUp),
}

/// What the supervisor does about an observation.
pub fn decide(observation: Observation, policy: &Policy) -> Decision {
    match observation {
        Observation::Stages { at, stages } => match fault::first_fault(at, stages, policy) {
            Some(fault) => Decision::Blame(fault),
            None if stages.iter().all(|stage| stage.exit.is_some() && !stage.awaits_restart) => Decision::Finish,
            None => Decision::Continue,
        },
        Observation::FaultyStage { .. } if !policy.is_live => Decision::EndAttempt,
        Observation::FaultyStage { fault, is_ending, restarts, ran_for } => {
            restart::of_stage(fault, is_ending, restarts, ran_for, policy)
                .map_or_else(Decision::GiveUp, |(delay, restart)| Decision::RestartStage { delay, restart })
        }
        Observation::FailedAttempt { fault, is_ending, barrier, budget, is_memory_low } => {
            restart::of_run(fault, is_ending, barrier, budget, is_memory_low, policy)
                .map_or_else(Decision::GiveUp, |(delay, budget)| Decision::RestartRun { delay, budget })
        }
    }
}
