//! `replica fuse`: two models as one file.

use crate::argument;
use anyhow::Context;
use formats::atomic_file::write_atomic;
use std::path::PathBuf;
use std::process::ExitCode;

/// Write two models as one file that fuses them.
///
/// Both have the same classes. The weighted geometric mean of their probabilities decides.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage")]
pub struct Args {
    /// Model file, usually of a network on images
    first: PathBuf,
    /// Model file, usually of a network on points
    second: PathBuf,
    /// File to write; created or replaced
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Share of the first model in the mean, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, value_parser = argument::share)]
    share: f64,
    /// The first model sees every N-th sweep only (1 to 16)
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=16))]
    every: u8,
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let bytes = segmentation::fuse(&args.first, &args.second, args.share, usize::from(args.every))?;
    write_atomic(&args.out, &bytes).with_context(|| args.out.display().to_string())?;
    Ok(ExitCode::SUCCESS)
}
