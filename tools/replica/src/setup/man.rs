//! `replica man`: manual pages.

use anyhow::Context;
use std::path::PathBuf;
use std::process::ExitCode;

/// Write manual pages: one for each command.
///
/// Read one with `man DIR/replica-inspect.1`. `replica-launch --man DIR` writes that of replica-launch.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage")]
pub struct Args {
    /// Folder of the pages
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Runs the command. `all` is the whole command line.
pub fn run(args: &Args, all: clap::Command) -> anyhow::Result<ExitCode> {
    let folder = &args.out;
    let written = std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(all, folder));
    written.with_context(|| format!("{}: cannot write the pages", folder.display()))?;
    Ok(ExitCode::SUCCESS)
}
