//! `replica swap`: replaces a stage of a running pipeline by another program or other settings.

use super::attach::RunArgument;
use anyhow::bail;
use command_line::say;
use run::control::{Answer, Request, SwapRequest};
use std::path::PathBuf;
use std::process::ExitCode;

/// Replace a stage of a running pipeline.
///
/// The supervisor drains the pipeline to a barrier, replaces the stage and continues. No message is lost or duplicated. A
/// replacement that does not fit is refused with the reasons, and the run continues unchanged. Without any change the stage's
/// program is restarted.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 swapped, 1 refused, undone or failed, 2 wrong usage")]
pub struct Args {
    /// Name of the stage: its table in launch.toml
    stage: String,
    /// New program; a relative path starts at the current folder
    #[arg(long)]
    program: Option<PathBuf>,
    /// New value of a setting, as in launch.toml (may be repeated)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Remove a setting, so that its default applies (may be repeated)
    #[arg(long, value_name = "KEY")]
    unset: Vec<String>,
    /// Go back to the program and settings that the run started with; other options then change these
    #[arg(long)]
    back: bool,
    #[command(flatten)]
    run: RunArgument,
}

/// Runs the command. The result goes to stdout, the progress to stderr.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let program = args.program.as_ref().map(std::path::absolute).transpose()?;
    let request = Request::Swap(SwapRequest {
        stage: args.stage.clone(),
        back: args.back,
        program,
        unset: args.unset.clone(),
        set: args.set.clone(),
    });
    match args.run.find_alive()?.ask(&request)? {
        Answer::Swapped(swapped) if swapped.undone.is_none() => {
            say!("{swapped}")?;
            Ok(ExitCode::SUCCESS)
        }
        Answer::Swapped(swapped) => bail!("{swapped}"),
        Answer::Refused(reasons) => bail!("swap refused, nothing was changed:\n{}", reasons.join("\n")),
        Answer::Ended(outcome) => bail!("the run ended ({outcome}) before the swap"),
        Answer::Working(_) => bail!("the supervisor closed the connection without an answer"),
    }
}
