//! `replica campaign plan`: sizes of the jobs, and machines against hours, from the drives that are finished.

use super::File;
use super::sizes::Sizes;
use crate::control::batch::plan;
use std::process::ExitCode;

/// Estimate time, memory and disk of a campaign.
///
/// Computed from the drives that are finished; the others count in proportion to their bytes. Run a few typical drives first.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 no drive is finished, 2 wrong usage, 78 refused\n\n\
                        Example: replica campaign plan campaign.toml --machines 100")]
pub struct Args {
    #[command(flatten)]
    file: File,
    /// Largest number of machines
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    machines: u32,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let campaign = args.file.load()?;
    let table = plan::text(&campaign.drives, args.machines as usize)?;
    let sizes = Sizes::new(&campaign);
    let text = |value: Option<u32>| value.map_or_else(|| "unknown".to_owned(), |value| value.to_string());
    super::print(&format!(
        "a job needs {} MB of memory, {} MB of it in /dev/shm, and at most {} minutes (from {} finished drives)\n{table}",
        text(sizes.memory_mb),
        text(sizes.shared_memory_mb),
        text(sizes.minutes),
        sizes.n_measured
    ));
    Ok(ExitCode::SUCCESS)
}
