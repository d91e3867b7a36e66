//! `--check --resume`: whether a start with `--resume` would continue the run in the output.

use super::error::SuperviseError;
use crate::identity::Files;
use crate::plan::Plan;
use crate::run_folder::{Patience, RunFolder, RunFolderError, canonical};
use run::{Mode, exit};
use std::time::Duration;

/// The exit code: success if the output has no run yet, or a run of this plan, even a finished one. `wait`: longest wait for
/// another run that writes into the output.
pub fn check_resume(plan: Plan, wait: Duration) -> u8 {
    match refuse_other_run(plan, wait) {
        Ok(()) => exit::DONE,
        Err(error) => {
            tracing::error!("replica-launch: {error}");
            error.exit_code()
        }
    }
}

fn refuse_other_run(mut plan: Plan, wait: Duration) -> Result<(), SuperviseError> {
    if plan.context.mode == Mode::Live {
        return Err(SuperviseError::LiveResume);
    }
    // A drive that must be simulated has no run yet.
    if !plan.context.output.exists() || plan.simulate.is_some() {
        return Ok(());
    }
    let folder = RunFolder::lock(&plan.context.output, &mut Patience { wait, is_over: &mut || false })?;
    plan.context.output = canonical(&plan.context.output)?;
    plan.context.drive = canonical(&plan.context.drive)?;
    if !folder.has_begun() {
        return Ok(folder.refuse_earlier_results()?);
    }
    let files = Files::read(&plan, &Files::default()).map_err(RunFolderError::from)?;
    Ok(folder.refuse_other_plan(&plan, &files)?)
}
