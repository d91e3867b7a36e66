//! `replica evaluate`: how well a result agrees with the truth.

mod instances;

use std::process::ExitCode;

/// Scores of a result.
#[derive(clap::Args, Debug)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand, Debug)]
enum What {
    /// SM, PQ, SQ, RQ and mIoU of vehicles and pedestrians, or of other classes.
    Instances(instances::Args),
}

/// Prints the scores as a table.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.what {
        What::Instances(args) => instances::run(args),
    }
}
