//! Run control: commands that observe, record, replay or change a run.

mod agent;
mod attach;
mod batch;
mod campaign;
mod columns;
mod echo;
mod hz;
mod metrics;
mod record;
mod replay;
mod status;
mod stop;
mod swap;
mod topics;

use command_line::terminal::ignore_broken_pipe;
use std::process::ExitCode;

/// The subcommands.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    Batch(batch::Args),
    Campaign(campaign::Args),
    Status(status::Args),
    Topics(topics::Args),
    Echo(echo::Args),
    Hz(hz::Args),
    Record(record::Args),
    Replay(replay::Args),
    Swap(swap::Args),
    Stop(stop::Args),
    Agent(agent::Args),
}

impl Command {
    /// Runs the command.
    pub fn run(&self) -> anyhow::Result<ExitCode> {
        match self {
            Command::Batch(args) => batch::run(args),
            Command::Campaign(args) => campaign::run(args),
            Command::Status(args) => ignore_broken_pipe(status::run(args)),
            Command::Topics(args) => ignore_broken_pipe(topics::run(args)),
            Command::Echo(args) => ignore_broken_pipe(echo::run(args)),
            Command::Hz(args) => ignore_broken_pipe(hz::run(args)),
            Command::Record(args) => record::run(args),
            Command::Replay(args) => replay::run(args),
            Command::Swap(args) => swap::run(args),
            Command::Stop(args) => stop::run(args),
            Command::Agent(args) => agent::run(args),
        }
    }
}
