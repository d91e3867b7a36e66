//! `replica campaign cancel`: ends the jobs of a campaign.

use super::File;
use super::slurm::{self, Cancel};
use super::submissions::Submissions;
use std::process::ExitCode;

/// End the jobs of a campaign: running drives drain.
///
/// Results and barriers stay: `replica campaign resume` continues.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage, 78 refused\n\n\
                        Example: replica campaign cancel campaign.toml")]
pub struct Args {
    #[command(flatten)]
    file: File,
    /// Stop running drives at once; they continue from their last barrier
    #[arg(long)]
    now: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let campaign = args.file.load()?;
    let submissions = Submissions::load_submitted(&campaign)?;
    let states = submissions.states()?;
    let active: Vec<&str> =
        states.drives.iter().flatten().filter(|task| task.is_active()).map(|task| task.job.as_str()).collect();
    // First, or it would start at the end of the array.
    if let Some(finish) = states.finish.as_ref().filter(|finish| finish.is_active()) {
        slurm::cancel(&finish.job, Cancel::Now)?;
    }
    let how = if args.now { Cancel::Now } else { Cancel::Drain };
    for submission in &submissions.jobs {
        let own = format!("{}_", submission.array);
        if active.iter().any(|job| job.starts_with(&own)) {
            slurm::cancel(&submission.array, how)?;
        }
    }
    let active = active.len();
    let plural = if active == 1 { "" } else { "s" };
    crate::control::campaign::print(&format!("{active} active drive{plural} of {} cancelled\n", states.drives.len()));
    Ok(ExitCode::SUCCESS)
}
