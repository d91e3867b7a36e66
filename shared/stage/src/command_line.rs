//! The command line of every stage's program.

use crate::program::Program;
use crate::{Port, exit};
use clap::error::ErrorKind;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
#[cfg(feature = "alone")]
use run::Change;
use serde::Serialize;
use std::ffi::OsString;
use std::fmt::Write;
use std::path::PathBuf;

/// `--describe` without a request.
pub(crate) const NO_REQUEST: &str = "";

#[derive(Parser)]
#[command(arg_required_else_help = true)]
pub(crate) struct CommandLine {
    /// Print inputs, outputs and settings as JSON; with REQUEST, as the launch file of the request sets them
    #[arg(long, value_name = "REQUEST", num_args = 0..=1, default_missing_value = NO_REQUEST, conflicts_with = "check")]
    pub(crate) describe: Option<String>,
    /// Print the problems of a launch file's table as JSON
    #[arg(long, value_name = "REQUEST")]
    pub(crate) check: Option<String>,
    #[command(subcommand)]
    pub(crate) action: Option<Action>,
}

#[derive(Subcommand)]
pub(crate) enum Action {
    /// Run under a supervisor; or alone, on a recording of the inputs
    ///
    /// Alone, the stage reads its inputs from a recording (a source: from a drive), writes its outputs into another recording
    /// and reports the time of the steps. It needs no supervisor and no shared memory.
    Run(RunArguments),
}

#[derive(Args)]
pub(crate) struct RunArguments {
    /// Assignment file of the supervisor
    #[cfg_attr(feature = "alone", arg(conflicts_with_all = ["recording", "record", "launch", "set", "unset", "drive", "output", "json"]))]
    pub(crate) assignment: Option<PathBuf>,
    /// Run as part of a run on another host, connected through standard input; ends with the process AGENT
    #[arg(long, value_name = "AGENT", hide = true, conflicts_with = "assignment")]
    pub(crate) linked: Option<u32>,
    #[cfg(feature = "alone")]
    #[command(flatten)]
    pub(crate) alone: AloneArguments,
}

#[cfg(feature = "alone")]
#[derive(Args)]
pub(crate) struct AloneArguments {
    /// Recording of the inputs
    #[arg(long, value_name = "IN.mcap")]
    pub(crate) recording: Option<PathBuf>,
    /// Recording of the outputs; created
    #[arg(long, value_name = "OUT.mcap")]
    pub(crate) record: Option<PathBuf>,
    /// Launch file with the settings; without it, the defaults apply
    #[arg(long, value_name = "launch.toml")]
    pub(crate) launch: Option<PathBuf>,
    /// Set a key of the launch file (may be repeated)
    #[arg(long, value_name = "TABLE.KEY=VALUE", value_parser = Change::set)]
    pub(crate) set: Vec<Change>,
    /// Leave out a key of the launch file, so that its default applies (may be repeated); --set may set it again
    #[arg(long, value_name = "TABLE.KEY", value_parser = Change::unset)]
    pub(crate) unset: Vec<Change>,
    /// Drive that a source reads
    #[arg(long, value_name = "FOLDER")]
    pub(crate) drive: Option<PathBuf>,
    /// Folder for result files
    #[arg(long, value_name = "FOLDER")]
    pub(crate) output: Option<PathBuf>,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// The parsed arguments, or the exit code after help or a usage error has been printed.
pub(crate) fn parse(program: &dyn Program, arguments: Vec<OsString>) -> Result<CommandLine, u8> {
    let parsed =
        command(program).try_get_matches_from(arguments).and_then(|matches| CommandLine::from_arg_matches(&matches));
    parsed.map_err(|error| print(&error))
}

/// Prints a usage error. Returns the exit code.
pub(crate) fn usage(program: &dyn Program, text: &str) -> u8 {
    print(&command(program).error(ErrorKind::ValueValidation, text))
}

/// Prints an answer as one line of JSON. Returns the exit code.
pub(crate) fn print_json<T: Serialize>(value: &T) -> u8 {
    match serde_json::to_string(value) {
        Ok(text) => print_line(&text),
        Err(error) => unprinted(&error.into()),
    }
}

/// Prints an answer. Returns the exit code. A closed standard output is not an error.
pub(crate) fn print_line(text: &str) -> u8 {
    // Not `println!`, which panics if the reader has closed its end.
    match std::io::Write::write_all(&mut std::io::stdout(), format!("{text}\n").as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => unprinted(&error),
        _ => exit::DONE,
    }
}

fn unprinted(error: &std::io::Error) -> u8 {
    eprintln!("standard output: {error}");
    exit::FAILED
}

fn print(error: &clap::Error) -> u8 {
    // Without a terminal or a pipe, the answer cannot be printed.
    let _ = error.print();
    if error.exit_code() == 0 { exit::DONE } else { exit::USAGE }
}

fn command(program: &dyn Program) -> clap::Command {
    CommandLine::command()
        .name(program.name())
        .about(format!("Stage {} of REPLICA. The supervisor, replica-launch, starts it.", program.name()))
        .after_help(reference(program))
}

/// Topics and settings of a stage.
fn reference(program: &dyn Program) -> String {
    let topics = |ports: &[Port]| match ports {
        [] => "none".to_owned(),
        ports => ports.iter().map(Port::topic).collect::<Vec<_>>().join(", "),
    };
    let mut text = format!("Inputs: {}\nOutputs: {}", topics(&program.inputs()), topics(&program.outputs()));
    let fields = program.fields();
    if fields.is_empty() {
        return text;
    }
    // Writing to a string cannot fail.
    let _ = write!(text, "\n\nSettings in [{}] of launch.toml:", program.name());
    for field in fields {
        let _ = write!(text, "\n  {} = {} ({})", field.key, field.default, field.kind);
        let texts = [field.meaning.trim(), field.rule.trim()];
        for line in texts.into_iter().filter(|text| !text.is_empty()) {
            let _ = write!(text, "\n      {line}");
        }
    }
    text
}
