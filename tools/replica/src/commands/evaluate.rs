//! `replica evaluate`: how well a result agrees with the truth.

mod classes;
mod instances;
mod map;
mod projections;
mod trajectory;

use std::process::ExitCode;

/// Scores of results against truth.
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
    /// Poses: absolute and relative errors as evo has them, segments as KITTI has them.
    Trajectory(trajectory::Args),
    /// Clouds: thickness of facades, mean map entropy, distance to the truth.
    Map(map::Args),
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.what {
        What::Classes(args) => classes::run(args),
        What::Instances(args) => instances::run(args),
        What::Projections(args) => projections::run(args).map(|()| ExitCode::SUCCESS),
        What::Trajectory(args) => trajectory::run(args),
        What::Map(args) => map::run(args),
    }
}
