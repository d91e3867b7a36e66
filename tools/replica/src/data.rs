//! Data: commands that make, convert, inspect and compare drives, clouds, images and recordings.

mod compare;
mod convert;
mod deliver;
mod grab;
mod import;
mod inspect;
mod instances;
mod new_folder;
mod report;
mod rig;
mod scene;
mod send;
mod simulate;
mod survey;
mod view;

use allocator::{Keep, restart_with_kept_memory};
use std::process::ExitCode;

/// The subcommands.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    Import(import::Args),
    Rig(rig::Args),
    Convert(convert::Args),
    Inspect(inspect::Args),
    Report(report::Args),
    View(view::Args),
    Compare(compare::Args),
    Instances(instances::Args),
    Survey(survey::Args),
    Deliver(deliver::Args),
    Scene(scene::Args),
    Send(send::Args),
    Grab(grab::Args),
    /// Simulate a drive through a procedural town.
    Simulate(simulate::Args),
}

impl Command {
    /// Runs the command.
    pub fn run(&self) -> anyhow::Result<ExitCode> {
        match self {
            Command::Import(args) => import::run(args),
            Command::Rig(args) => rig::run(args),
            Command::Convert(args) => convert::run(args),
            Command::Inspect(args) => inspect::run(args),
            Command::Report(args) => report::run(args),
            Command::View(args) => view::run(args),
            Command::Compare(args) => compare::run(args),
            Command::Instances(args) => instances::run(args),
            Command::Deliver(args) => {
                restart_with_kept_memory(Keep::Large);
                deliver::run(args)
            }
            Command::Survey(args) => {
                restart_with_kept_memory(Keep::Large);
                survey::run(args)
            }
            Command::Scene(args) => {
                restart_with_kept_memory(Keep::Large);
                scene::run(args)
            }
            Command::Send(args) => send::run(args),
            Command::Grab(args) => grab::run(args),
            Command::Simulate(args) => simulate::run(args),
        }
    }
}
