//! Setup: commands that check this machine, install the command line and create a stage.

mod doctor;
mod new_stage;

use command_line::{completions, man};
use std::process::ExitCode;

/// The subcommands.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    Doctor(doctor::Args),
    /// Print the completions of a shell.
    ///
    /// `replica-launch --completions SHELL` prints the completions of replica-launch.
    #[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                      Example: replica completions bash > ~/.local/share/bash-completion/completions/replica")]
    Completions(completions::Args),
    /// Write manual pages: one for each command.
    ///
    /// Read one with `man DIR/replica-inspect.1`. `replica-launch --man DIR` writes the page of replica-launch.
    #[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                      Example: replica man --out ~/.local/share/man/man1")]
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
