//! Lab: commands that train models, evaluate results and measure cost.

mod bench;
pub mod evaluate;
mod fuse;
pub mod instances;
mod materials;
mod recorded_classes;
mod train;
mod true_points;

use allocator::{Keep, restart_with_kept_memory};
use std::process::ExitCode;

/// The subcommands.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    Train(train::Args),
    Fuse(fuse::Args),
    Evaluate(Box<evaluate::Args>),
    Instances(instances::Args),
    Bench(bench::Args),
}

impl Command {
    /// Runs the command.
    pub fn run(&self) -> anyhow::Result<ExitCode> {
        match self {
            Command::Train(args) => {
                restart_with_kept_memory(Keep::Large);
                train::run(args)
            }
            Command::Fuse(args) => fuse::run(args),
            Command::Evaluate(args) => evaluate::run(args),
            Command::Instances(args) => instances::run(args),
            Command::Bench(args) => bench::run(args),
        }
    }
}
