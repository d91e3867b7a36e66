//! Help that shows the subcommands in groups: clap has one heading for all of them.

use clap::{Command, Subcommand};
use std::fmt::Write;

const HELP_TEMPLATE: &str = "{about}\n\n{usage-heading} {usage}{after-help}\n\nOptions:\n{options}";

const EXAMPLE: &str = "\n\nExample: ";

const EXIT_CODES: &str = "\
Exit codes:
  0   done
  1   failed
  2   wrong usage
  3   done, but incomplete or different: the command's help says when
  78  invalid configuration";

/// The subcommands of one audience.
pub struct Group {
    heading: &'static str,
    command: Command,
}

impl Group {
    /// The subcommands of `S` under a heading.
    pub fn new<S: Subcommand>(heading: &'static str) -> Self {
        Self { heading, command: S::augment_subcommands(Command::new("group")) }
    }
}

/// The command line of a program whose help lists its subcommands by group, then the exit codes and the options, and ends with an
/// example.
pub fn with_groups(command: Command, groups: &[Group], example: &str) -> Command {
    let after_help = format!(
        "{}{EXIT_CODES}\n\n`{} COMMAND --help` describes one command.",
        grouped_subcommands(groups),
        command.get_name()
    );
    let command = command.help_template(format!("{HELP_TEMPLATE}{EXAMPLE}{example}")).after_help(after_help);
    with_negative_values(command)
}

/// Makes a negative number after an option the value of the option. The parser of the value then states the
/// rule; otherwise clap takes `-1` for an unknown option.
fn with_negative_values(command: Command) -> Command {
    let command = command.mut_args(|arg| {
        let takes_value = arg.get_action().takes_values() && !arg.is_positional();
        if takes_value { arg.allow_negative_numbers(true) } else { arg }
    });
    command.mut_subcommands(with_negative_values)
}

fn grouped_subcommands(groups: &[Group]) -> String {
    let width = groups.iter().flat_map(names).map(str::len).max().unwrap_or(0);
    let mut text = String::new();
    for group in groups {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}:", group.heading);
        for subcommand in group.command.get_subcommands() {
            let about = subcommand.get_about().map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(text, "  {:<width$}  {about}", subcommand.get_name());
        }
        text.push('\n');
    }
    text
}

fn names(group: &Group) -> impl Iterator<Item = &str> {
    group.command.get_subcommands().map(Command::get_name)
}

/// For tests of a program: panics if a subcommand is in no group or in several, if its summary is not one short line, if the
/// definition of an argument contradicts another one, or if a help text does not end with a valid example.
pub fn assert_consistent(command: &Command, groups: &[Group]) {
    let mut all: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
    let mut grouped: Vec<&str> = groups.iter().flat_map(names).collect();
    all.sort_unstable();
    grouped.sort_unstable();
    assert_eq!(grouped, all);
    grouped.dedup();
    assert_eq!(grouped, all, "a subcommand is in two groups");
    let help = command.clone().render_help().to_string();
    for subcommand in command.get_subcommands() {
        let entries = help.lines().filter(|line| line.split_whitespace().next() == Some(subcommand.get_name()));
        assert_eq!(entries.count(), 1, "{}:\n{help}", subcommand.get_name());
        let about = subcommand.get_about().map(ToString::to_string).unwrap_or_default();
        assert!((1..=66).contains(&about.len()), "{}: {about:?}", subcommand.get_name());
    }
    command.clone().debug_assert();
    assert_valid_example(command, &help);
    assert_documented(command, command);
}

/// Panics if the help of a subcommand lacks the exit codes, or does not end with a valid example.
fn assert_documented(program: &Command, command: &Command) {
    for subcommand in command.get_subcommands() {
        let help = subcommand.get_after_help().map(ToString::to_string).unwrap_or_default();
        assert!(help.contains("Exit codes: "), "{}: no exit codes", subcommand.get_name());
        assert_valid_example(program, &help);
        assert_documented(program, subcommand);
    }
}

/// Panics if a help text does not end with an example whose arguments `program` accepts.
fn assert_valid_example(program: &Command, help: &str) {
    let (_, example) = help.trim_end().rsplit_once(EXAMPLE).unwrap_or_else(|| panic!("no example in {help:?}"));
    assert!(!example.contains('\n'), "{example:?} is not at the end of the help");
    let pipeline = example.split(" > ").next().unwrap_or_default();
    let words = pipeline.rsplit(" | ").next().unwrap_or_default().split_whitespace();
    assert!(words.clone().next() == Some(program.get_name()), "{example}");
    if let Err(error) = program.clone().try_get_matches_from(words) {
        panic!("{example}: {error}");
    }
}
