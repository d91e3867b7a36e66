//! The command line: one flat list of subcommands, shown in four groups.

use crate::{control, data, lab, setup};
use clap::{Command, CommandFactory, FromArgMatches, Parser, Subcommand};
use std::fmt::Write;
use std::process::ExitCode;

/// Records, inspects and evaluates what `replica-launch` runs.
#[derive(Parser)]
#[command(name = "replica", version = env!("REPLICA_VERSION"))]
enum Cli {
    #[command(flatten)]
    Control(control::Command),
    #[command(flatten)]
    Data(data::Command),
    #[command(flatten)]
    Lab(lab::Command),
    #[command(flatten)]
    Setup(setup::Command),
}

/// A parsed command line.
pub struct Parsed(Cli);

const HELP_TEMPLATE: &str = "{about}\n\n{usage-heading} {usage}{after-help}\n\nOptions:\n{options}";

const EXIT_CODES: &str = "\
Exit codes:
  0   done
  1   failed
  2   wrong usage
  3   done, but incomplete or different: the command's help says when
  78  invalid configuration

`replica COMMAND --help` describes one command.";

/// Parses the arguments of the process. Wrong arguments end the process with exit code 2.
pub fn parse() -> Parsed {
    match Cli::from_arg_matches(&command().get_matches()) {
        Ok(cli) => Parsed(cli),
        Err(error) => error.exit(),
    }
}

impl Parsed {
    /// Runs the command.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        match self.0 {
            Cli::Control(command) => command.run(),
            Cli::Data(command) => command.run(),
            Cli::Lab(command) => command.run(),
            Cli::Setup(setup) => setup.run(command()),
        }
    }
}

/// The subcommands of one audience.
struct Group {
    heading: &'static str,
    command: Command,
}

fn groups() -> [Group; 4] {
    let group = |heading, command| Group { heading, command };
    [
        group("Run control", control::Command::augment_subcommands(Command::new("control"))),
        group("Data", data::Command::augment_subcommands(Command::new("data"))),
        group("Lab", lab::Command::augment_subcommands(Command::new("lab"))),
        group("Setup", setup::Command::augment_subcommands(Command::new("setup"))),
    ]
}

/// The whole command line. Its help shows the groups: clap has one heading for all subcommands.
fn command() -> Command {
    Cli::command().help_template(HELP_TEMPLATE).after_help(grouped_subcommands())
}

fn grouped_subcommands() -> String {
    let mut text = String::new();
    for Group { heading, command } in groups() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{heading}:");
        for subcommand in command.get_subcommands() {
            let about = subcommand.get_about().map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(text, "  {:<11}  {about}", subcommand.get_name());
        }
        text.push('\n');
    }
    text + EXIT_CODES
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_subcommand_is_in_exactly_one_group() {
        let command = command();
        let mut all: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
        let groups = groups();
        let names_of = |group| Command::get_subcommands(group).map(Command::get_name);
        let mut grouped: Vec<&str> = groups.iter().flat_map(|group| names_of(&group.command)).collect();
        all.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(grouped, all);
        assert_eq!(all.len(), 32);
        grouped.dedup();
        assert_eq!(grouped, all, "a subcommand is in two groups");
    }

    #[test]
    fn help_lists_each_subcommand_once_with_its_summary() {
        let mut command = command();
        let help = command.render_help().to_string();
        // clap adds `help` itself.
        for subcommand in command.get_subcommands().filter(|subcommand| subcommand.get_name() != "help") {
            let entry = format!("\n  {:<11}  ", subcommand.get_name());
            assert_eq!(help.matches(&entry).count(), 1, "{}:\n{help}", subcommand.get_name());
            let about = subcommand.get_about().map(ToString::to_string).unwrap_or_default();
            assert!((1..=66).contains(&about.len()), "{}: {about:?}", subcommand.get_name());
        }
    }

    #[test]
    fn definition_of_every_argument_is_consistent() {
        command().debug_assert();
    }
}
