//! `replica-lab evaluate`: compares results with ground truth.

mod classes;
mod instances;
mod map;
mod materials;
mod projections;
mod recorded_truth;
mod run;
pub mod trajectory;

use command_line::usage_error::UsageError;
use std::process::ExitCode;

/// Compare a result with ground truth.
///
/// With OUT, all results of a run are scored. A subcommand scores one kind of result. For a folder with the name of a subcommand,
/// write ./map.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    arg_required_else_help = true,
    after_help = "Exit codes: 0 done, 1 failed or OUT is a run of another drive, 2 wrong usage, 3 done, but less than --min-joined \
                  of the points have a true label\n\n\
                  Example: replica-lab evaluate out/sample --truth drives/sample"
)]
pub struct Args {
    #[command(subcommand)]
    result: Option<Evaluated>,
    #[command(flatten)]
    run: Option<run::Args>,
}

#[derive(Debug, clap::Subcommand)]
enum Evaluated {
    Classes(classes::Args),
    Instances(instances::Args),
    Projections(projections::Args),
    Trajectory(trajectory::Args),
    Map(map::Args),
    Materials(materials::Args),
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match (&args.result, &args.run) {
        (Some(Evaluated::Classes(args)), _) => classes::run(args),
        (Some(Evaluated::Instances(args)), _) => instances::run(args),
        (Some(Evaluated::Projections(args)), _) => projections::run(args),
        (Some(Evaluated::Trajectory(args)), _) => trajectory::run(args),
        (Some(Evaluated::Map(args)), _) => map::run(args),
        (Some(Evaluated::Materials(args)), _) => materials::run(args),
        (None, Some(args)) => run::run(args),
        (None, None) => Err(UsageError("evaluate needs OUT and --truth DRIVE, or a subcommand".to_owned()).into()),
    }
}
