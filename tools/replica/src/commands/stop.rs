//! `replica stop`: the end of a running pipeline.

use crate::attach::RunArgument;
use anyhow::bail;
use stage::control::{Answer, Request};
use std::process::ExitCode;

/// Ends a running pipeline as Ctrl-C does: what is on the way is finished, the rest of the drive is not read. Returns when the
/// run has ended.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// End it at once, without finishing what is on the way.
    #[arg(long)]
    now: bool,
    #[command(flatten)]
    run: RunArgument,
}

/// Runs the command. How the run ended goes to stdout.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let run = args.run.find_alive()?;
    match run.ask(&Request::Stop { now: args.now })? {
        Answer::Ended(outcome) => {
            println!("{outcome}: see {}", run.output.join("summary.json").display());
            Ok(if outcome == "failed" { ExitCode::FAILURE } else { ExitCode::SUCCESS })
        }
        Answer::Refused(reasons) => bail!("refused: {}", reasons.join("\n")),
        answer => bail!("the supervisor answered something else: {answer:?}"),
    }
}
