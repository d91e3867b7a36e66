//! Under construction.

use std::process::ExitCode;

/// None yet.
#[derive(clap::Args)]
pub struct Args {}

pub fn run(_args: &Args) -> anyhow::Result<ExitCode> {
    anyhow::bail!("under construction")
}
