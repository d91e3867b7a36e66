//! `replica evaluate`: compares results with ground truth.

mod classes;
mod instances;
mod map;
mod projections;
mod trajectory;

use std::process::ExitCode;

/// Compare a result with ground truth.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    result: Evaluated,
}

#[derive(Debug, clap::Subcommand)]
enum Evaluated {
    Classes(classes::Args),
    Instances(instances::Args),
    Projections(projections::Args),
    Trajectory(trajectory::Args),
    Map(map::Args),
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.result {
        Evaluated::Classes(args) => classes::run(args),
        Evaluated::Instances(args) => instances::run(args),
        Evaluated::Projections(args) => projections::run(args),
        Evaluated::Trajectory(args) => trajectory::run(args),
        Evaluated::Map(args) => map::run(args),
    }
}
