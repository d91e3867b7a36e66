//! `replica stop`: ends a running pipeline.

use super::attach::RunArgument;
use anyhow::bail;
use command_line::say;
use run::Outcome;
use run::control::{Answer, Request};
use std::process::ExitCode;

/// Stop a running pipeline.
///
/// Works like Ctrl-C in the terminal of `replica-launch`: the stages process the data that is in flight, and the rest of the
/// drive is not read. Returns when the run has ended, and prints the outcome.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 the run has ended, 1 no such run, refused, or the run failed, 2 wrong usage\n\n\
                  Example: replica stop --run out/sample")]
pub struct Args {
    /// Stop immediately: data in flight is not processed
    #[arg(long)]
    now: bool,
    #[command(flatten)]
    run: RunArgument,
}

/// Runs the command. The outcome of the run goes to stdout.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let run = args.run.find_alive()?;
    match run.ask(&Request::Stop { now: args.now })? {
        Answer::Ended(outcome) => {
            say!("{outcome}: see {}", run.output.join("summary.json").display())?;
            Ok(match outcome {
                Outcome::Failed => ExitCode::FAILURE,
                Outcome::Done | Outcome::Drained | Outcome::Stopped => ExitCode::SUCCESS,
            })
        }
        Answer::Refused(reasons) => bail!("the supervisor refused to stop: {}", reasons.join("\n")),
        answer => bail!("unexpected answer of the supervisor: {answer:?}"),
    }
}
