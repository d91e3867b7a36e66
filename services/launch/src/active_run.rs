//! The active run of this supervisor.

use crate::identity::Files;
use crate::plan::Plan;
use crate::run_folder::RunFolder;
use ipc::Domain;
use run::Mode;

/// Plan, folder and name in shared memory. A swap replaces the plan.
pub struct ActiveRun {
    /// The checked launch file.
    pub plan: Plan,
    /// The files of the run.
    pub folder: RunFolder,
    /// The files of the plan at the start of the last attempt.
    pub files: Files,
    /// Its name in shared memory.
    pub domain: Domain,
}

impl ActiveRun {
    /// Whether sensors instead of a drive are the source.
    pub fn is_live(&self) -> bool {
        self.plan.context.mode == Mode::Live
    }
}
