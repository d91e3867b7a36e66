//! The subcommand `man`: manual pages.

use anyhow::Context;
use clap::Command;
use std::path::PathBuf;
use std::process::ExitCode;

/// Write manual pages: one for each command.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// Folder of the pages
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Writes the pages of the command line of a program.
pub fn run(args: &Args, command: Command) -> anyhow::Result<ExitCode> {
    let folder = &args.out;
    let written = std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(command, folder));
    written.with_context(|| format!("{}: cannot write the pages", folder.display()))?;
    Ok(ExitCode::SUCCESS)
}
