//! The subcommand `completions`: completions of a shell.

use crate::terminal::ignore_broken_pipe;
use clap::Command;
use clap_complete::{Shell, generate};
use std::io::Write;
use std::process::ExitCode;

/// Print the completions of a shell.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// The shell
    shell: Shell,
}

/// Prints the completions of the command line of a program.
pub fn run(args: &Args, mut command: Command) -> anyhow::Result<ExitCode> {
    let program = command.get_name().to_owned();
    let mut text = Vec::new();
    generate(args.shell, &mut command, program, &mut text);
    ignore_broken_pipe(std::io::stdout().write_all(&text).map_err(anyhow::Error::from))
}
