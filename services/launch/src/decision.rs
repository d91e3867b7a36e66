//! The decisions of the supervisor about observed faults.
//!
//! [`crate::supervise`] collects observations and carries decisions out. This module only decides: its functions are
//! pure. They must never read a clock, a file or a process, and never start or kill anything; all times are arguments
//! on one monotonic clock. Therefore each rule is one row of a table in `tests.rs`, without processes and without
//! sleeping.
//!
//! Each question has one function and its own answer type, so that a caller handles every answer.
//!
//! | question | function | file |
//! |---|---|---|
//! | When did a stage exit too early, hang or stall? Which stage is to blame? | [`judge`] | [`fault`] |
//! | Which exhausted resource caused the fault? | [`cause::Cause::from_evidence`] | [`cause`] |
//! | Live: restart the faulty stage alone, or give up? | [`restart_stage`] | [`restart`] |
//! | Offline: restart the run from the last barrier, or give up? | [`restart_run`] | [`restart`] |
//! | The limits that a launch file sets | [`Policy`] | `policy` |
//!
//! Start with [`judge`], which defines the order of the checks for faults. The callers are `supervise/attempt.rs`
//! (during an attempt) and `supervise.rs` (between two attempts).

pub mod cause;
pub mod fault;
mod policy;
pub mod restart;
#[cfg(test)]
mod tests;

pub use cause::Evidence;
pub use fault::{Fault, Judgment, ObservedStage, judge};
pub use policy::Policy;
pub use restart::{
    FailedAttempt, FaultyStage, GiveUp, RestartBudget, RunDecision, StageDecision, restart_run, restart_stage,
};
