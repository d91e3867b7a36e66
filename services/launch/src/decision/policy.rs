//! The rules of a run, from its launch file.

use crate::manifest::Run;
use crate::plan::PlannedStage;
use run::Mode;
use std::collections::BTreeMap;

/// The rules of a run, from its launch file.
#[derive(Clone, Debug)]
pub struct Policy {
    /// Live mode: stages are restarted one by one, and waiting for a sensor is not a fault.
    pub is_live: bool,
    /// A stage hangs if it sends no heartbeat for this long, s.
    pub hang_s: f64,
    /// A stage stalls if it makes no progress for this long, s.
    pub stall_s: f64,
    /// Stall limits of single stages, s; they replace `stall_s`.
    pub stage_stall_s: BTreeMap<String, f64>,
    /// Restarts without progress before the run is given up.
    pub restarts: u32,
    /// Pause before the first restart, s.
    pub restart_delay_s: f64,
}

impl Policy {
    /// The rules that `[run]` and the stages' tables set.
    pub fn new(run: &Run, stages: &[PlannedStage]) -> Self {
        let own = stages.iter().filter(|stage| stage.table.stall_s > 0.0);
        Self {
            is_live: run.mode == Mode::Live,
            hang_s: run.hang_s,
            stall_s: run.stall_s,
            stage_stall_s: own.map(|stage| (stage.name.clone(), stage.table.stall_s)).collect(),
            restarts: run.restarts,
            restart_delay_s: run.restart_delay_s,
        }
    }

    /// Stall limit of a stage, s.
    pub(super) fn stall_limit_s(&self, stage: &str) -> f64 {
        self.stage_stall_s.get(stage).copied().unwrap_or(self.stall_s)
    }
}
