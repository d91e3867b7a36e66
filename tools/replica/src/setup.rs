//! Setup: commands that check this machine, install the command line and begin a stage.

mod completions;
mod doctor;
mod man;
mod new_stage;

use std::process::ExitCode;

/// The subcommands.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    Doctor(doctor::Args),
    Completions(completions::Args),
    Man(man::Args),
    NewStage(new_stage::Args),
}

impl Command {
    /// Runs the command. `all` is the whole command line.
    pub fn run(&self, all: clap::Command) -> anyhow::Result<ExitCode> {
        match self {
            Command::Doctor(args) => doctor::run(args),
            Command::Completions(args) => completions::run(args, all),
            Command::Man(args) => man::run(args, all),
            Command::NewStage(args) => new_stage::run(args),
        }
    }
}
