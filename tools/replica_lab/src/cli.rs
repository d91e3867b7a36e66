//! The command line: one flat list of subcommands, shown in four groups.

use crate::materials::fit;
use crate::{bench, cube, evaluate, fuse, nearest, spectrum, train};
use allocator::{Keep, restart_with_kept_memory};
use clap::{Command, CommandFactory, FromArgMatches, Parser, Subcommand};
use command_line::groups::{Group, with_groups};
use command_line::{completions, man};
use std::process::ExitCode;

/// Trains models, scores results against ground truth, measures cost, and analyzes measurements.
#[derive(Parser)]
#[command(name = "replica-lab", version = env!("REPLICA_VERSION"))]
enum Cli {
    #[command(flatten)]
    Models(Models),
    #[command(flatten)]
    Scores(Scores),
    #[command(flatten)]
    Reflectances(Reflectances),
    #[command(flatten)]
    Setup(Setup),
}

#[derive(Subcommand)]
enum Models {
    Train(train::Args),
    Fuse(fuse::Args),
    Nearest(nearest::Args),
    FitMaterials(fit::Args),
}

#[derive(Subcommand)]
enum Scores {
    Evaluate(Box<evaluate::Args>),
    Bench(bench::Args),
}

#[derive(Subcommand)]
enum Reflectances {
    Cube(Box<cube::Args>),
    Spectrum(Box<spectrum::Args>),
}

#[derive(Subcommand)]
enum Setup {
    #[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                      Example: replica-lab completions bash > ~/.local/share/bash-completion/completions/replica-lab")]
    Completions(completions::Args),
    #[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                      Example: replica-lab man --out ~/.local/share/man/man1")]
    Man(man::Args),
}

/// A parsed command line.
pub struct Parsed(Cli);

/// Parses the arguments of the process. Wrong arguments end the process with exit code 2.
pub fn parse() -> Parsed {
    match Cli::from_arg_matches(&command().get_matches()) {
        Ok(cli) => Parsed(cli),
        Err(error) => error.exit(),
    }
}

impl Parsed {
    /// Runs the command.
    pub fn run(&self) -> anyhow::Result<ExitCode> {
        match &self.0 {
            Cli::Models(Models::Train(args)) => {
                restart_with_kept_memory(Keep::Large);
                train::run(args)
            }
            Cli::Models(Models::Fuse(args)) => fuse::run(args),
            Cli::Models(Models::Nearest(args)) => nearest::run(args),
            Cli::Models(Models::FitMaterials(args)) => fit::run(args),
            Cli::Scores(Scores::Evaluate(args)) => evaluate::run(args),
            Cli::Scores(Scores::Bench(args)) => bench::run(args),
            Cli::Reflectances(Reflectances::Cube(args)) => cube::run(args),
            Cli::Reflectances(Reflectances::Spectrum(args)) => spectrum::run(args),
            Cli::Setup(Setup::Completions(args)) => completions::run(args, command()),
            Cli::Setup(Setup::Man(args)) => man::run(args, command()),
        }
    }
}

fn groups() -> [Group; 4] {
    [
        Group::new::<Models>("Models"),
        Group::new::<Scores>("Scores and cost"),
        Group::new::<Reflectances>("Reflectances"),
        Group::new::<Setup>("Setup"),
    ]
}

fn command() -> Command {
    with_groups(Cli::command(), &groups(), "replica-lab evaluate out/sample --truth drives/sample")
}

#[cfg(test)]
mod tests {
    use super::*;
    use command_line::groups::assert_consistent;

    #[test]
    fn help_lists_every_subcommand_in_one_group() {
        assert_consistent(&command(), &groups());
    }
}
