//! `replica evaluate`: how well a result agrees with the truth.

mod classes;
mod instances;
mod projections;

use std::process::ExitCode;

/// Scores of predictions against truth, pooled over all clouds.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Classes of points: precision, recall, IoU of each class, mIoU, overall accuracy, confusion matrix.
    Classes(classes::Args),
    /// SM, PQ, SQ, RQ and mIoU of vehicles and pedestrians, or of other classes.
    Instances(instances::Args),
    /// What range images lose: collisions by size, and accuracy by method of back-projection.
    Projections(projections::Args),
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.what {
        What::Classes(args) => classes::run(args),
        What::Instances(args) => instances::run(args),
        What::Projections(args) => projections::run(args).map(|()| ExitCode::SUCCESS),
    }
}
