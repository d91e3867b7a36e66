//! `replica completions`: completions of a shell.

use crate::terminal::ignore_broken_pipe;
use clap_complete::{Shell, generate};
use std::io::Write;
use std::process::ExitCode;

/// Print the completions of a shell.
///
/// bash: replica completions bash > ~/.local/share/bash-completion/completions/replica; `replica-launch --completions SHELL` prints
/// those of replica-launch.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage")]
pub struct Args {
    /// The shell
    shell: Shell,
}

/// Runs the command. `all` is the whole command line.
pub fn run(args: &Args, mut all: clap::Command) -> anyhow::Result<ExitCode> {
    let mut text = Vec::new();
    generate(args.shell, &mut all, "replica", &mut text);
    ignore_broken_pipe(std::io::stdout().write_all(&text).map_err(anyhow::Error::from))
}
