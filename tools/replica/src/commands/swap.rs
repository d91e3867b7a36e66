//! `replica swap`: another program or other settings for a stage of a running pipeline.

use crate::attach::RunArgument;
use anyhow::bail;
use stage::control::{Answer, Request, SwapRequest};
use std::path::PathBuf;
use std::process::ExitCode;

/// Replaces a stage of a running pipeline: drains to a barrier, replaces, goes on. No message is lost or doubled; what does not
/// fit is refused, with the reasons, and the run is not disturbed. Without a change the stage's program is started anew.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The stage: its table in launch.toml.
    stage: String,
    /// Another program; a relative path starts at the current folder.
    #[arg(long)]
    program: Option<PathBuf>,
    /// Another value of a setting, as in launch.toml (may be repeated).
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Leave a setting out, as if launch.toml did not have it (may be repeated).
    #[arg(long, value_name = "KEY")]
    unset: Vec<String>,
    /// Go back to what the run was begun with; other options then count from there.
    #[arg(long)]
    back: bool,
    #[command(flatten)]
    run: RunArgument,
}

/// Runs the command. How it went goes to stdout, what is being done to stderr.
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
            println!("{swapped}");
            Ok(ExitCode::SUCCESS)
        }
        Answer::Swapped(swapped) => bail!("{swapped}"),
        Answer::Refused(reasons) => bail!("refused, and nothing was changed:\n{}", reasons.join("\n")),
        Answer::Ended(outcome) => bail!("the run came to its end ({outcome}) before the swap: nothing was changed"),
        Answer::Working(_) => bail!("the supervisor left without an answer"),
    }
}
