//! `replica campaign`: many drives as jobs of a scheduler, one drive a job.
//!
//! | file | idea |
//! |---|---|
//! | `campaign_file` | `campaign.toml` |
//! | `sizes` | time, memory and shared memory of a job, from the drives that are finished |
//! | `script` | the job scripts, which people can read and change |
//! | `slurm` | the commands of SLURM |
//! | `submissions` | what was submitted: `OUT/campaign/submissions.json` |
//! | `submit` | `submit` and `resume` |
//! | `status` | the engine's state of each drive, joined with the summary of its run |
//! | `cancel` | `cancel` |
//! | `finish` | the job after all drives: survey and deliveries |
//! | `plan` | sizes, and machines against hours |
//!
//! The scheduler decides where and when a drive runs; `replica batch` runs it. Nothing here knows a drive's progress except from
//! the files of its run.

mod campaign_file;
mod cancel;
mod finish;
mod plan;
mod script;
mod sizes;
mod slurm;
mod status;
mod submissions;
mod submit;

use campaign_file::{Campaign, CampaignError};
use command_line::say_error;
use run::exit;
use run::terminal::printable;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

/// Process many drives as jobs of a cluster.
///
/// The engine's state is read, never copied: `status` asks SLURM and reads the summaries of the runs.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 drives have doubts or are not finished, 78 refused\n\n\
                        Example: replica campaign submit campaign.toml --engine slurm"
)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Plan(plan::Args),
    Submit(submit::Args),
    Status(status::Args),
    Cancel(cancel::Args),
    Resume(submit::ResumeArgs),
    Finish(finish::Args),
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let done = match &args.command {
        Command::Plan(args) => plan::run(args),
        Command::Submit(args) => submit::run(args),
        Command::Status(args) => status::run(args),
        Command::Cancel(args) => cancel::run(args),
        Command::Resume(args) => submit::resume(args),
        Command::Finish(args) => finish::run(args),
    };
    done.or_else(|error| match error.downcast::<CampaignError>() {
        Ok(CampaignError { faults }) => {
            for fault in faults {
                say_error!("error: {fault}");
            }
            Ok(ExitCode::from(exit::CONFIGURATION))
        }
        Err(error) => Err(error),
    })
}

/// The file of every subcommand.
#[derive(Debug, clap::Args)]
struct File {
    /// Drives, launch file and engine of the campaign (TOML)
    campaign: PathBuf,
}

impl File {
    fn load(&self) -> anyhow::Result<Campaign> {
        Campaign::load(&self.campaign)
    }
}

/// The scheduler that runs the jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Engine {
    /// SLURM
    Slurm,
}

/// Prints to stdout. A reader that has closed the pipe does not end the command.
fn print(text: &str) {
    let mut stdout = std::io::stdout().lock();
    let _ = stdout.write_all(printable(text).as_bytes()).and_then(|()| stdout.flush());
}
