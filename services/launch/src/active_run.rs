//! The run that this supervisor works on.

use crate::identity::Files;
use crate::plan::Plan;
use crate::run_folder::RunFolder;
use ipc::Domain;
use run::Mode;

/// Plan, folder and name in shared memory. A swap replaces the plan.
pub struct ActiveRun {
    /// The checked launch file.
    pub plan: Plan,
    /// Where the run keeps its files.
    pub folder: RunFolder,
    /// The files of the plan when the last attempt started.
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
