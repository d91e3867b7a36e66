//! The command line: one flat list of subcommands, shown in three groups.

use crate::{control, data, setup};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, CommandFactory, FromArgMatches, Parser};
use command_line::groups::{Group, with_groups};
use command_line::usage_error::UsageError;
use std::process::ExitCode;

/// Controls, inspects and delivers what `replica-launch` runs.
#[derive(Parser)]
#[command(name = "replica", version = env!("REPLICA_VERSION"))]
enum Cli {
    #[command(flatten)]
    Control(control::Command),
    #[command(flatten)]
    Data(data::Command),
    #[command(flatten)]
    Setup(setup::Command),
}

/// A parsed command line.
pub struct Parsed(Cli);

/// Commands of `replica-lab`.
const LABORATORY: [&str; 6] = ["train", "fuse", "evaluate", "bench", "spectrum", "cube"];

/// Parses the arguments of the process. The error for a command of `replica-lab` names that program; other wrong arguments end
/// the process with exit code 2.
pub fn parse() -> Result<Parsed, UsageError> {
    let parsed = command().try_get_matches().and_then(|matches| Cli::from_arg_matches(&matches));
    parsed.map(Parsed).map_err(|error| match laboratory_command(&error) {
        Some(name) => UsageError(format!("the command `{name}` is in replica-lab\nhint: replica-lab {name} --help")),
        None => error.exit(),
    })
}

/// The command of `replica-lab` that was given to this program.
fn laboratory_command(error: &clap::Error) -> Option<&'static str> {
    let (ErrorKind::InvalidSubcommand, Some(ContextValue::String(given))) =
        (error.kind(), error.get(ContextKind::InvalidSubcommand))
    else {
        return None;
    };
    LABORATORY.into_iter().find(|name| name == given)
}

impl Parsed {
    /// Runs the command.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        match self.0 {
            Cli::Control(command) => command.run(),
            Cli::Data(command) => command.run(),
            Cli::Setup(setup) => setup.run(command()),
        }
    }
}

fn groups() -> [Group; 3] {
    [
        Group::new::<control::Command>("Run control"),
        Group::new::<data::Command>("Data"),
        Group::new::<setup::Command>("Setup"),
    ]
}

/// The whole command line.
fn command() -> Command {
    with_groups(Cli::command(), &groups(), "replica inspect out/sample")
}

#[cfg(test)]
mod tests {
    use super::*;
    use command_line::groups::assert_consistent;

    #[test]
    fn help_lists_every_subcommand_in_one_group() {
        assert_consistent(&command(), &groups());
        assert_eq!(command().get_subcommands().count(), 29);
    }

    #[test]
    fn only_commands_of_the_laboratory_are_named_as_such() {
        let named = |name: &str| {
            command().try_get_matches_from(["replica", name, "--out", "x"]).map_err(|e| laboratory_command(&e))
        };
        for name in LABORATORY {
            assert_eq!(named(name).err(), Some(Some(name)));
        }
        assert_eq!(named("trian").err(), Some(None));
        assert_eq!(named("inspect").err(), Some(None), "a command of this program with wrong arguments");
    }
}
