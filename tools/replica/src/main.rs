//! `replica`: the command line tool beside `replica-launch`. Data goes to stdout, diagnostics go to stderr.

mod byte_values;
mod cli;
mod control;
mod data;
mod setup;

use std::process::ExitCode;

fn main() -> ExitCode {
    let done = cli::parse().map_err(anyhow::Error::from).and_then(cli::Parsed::run);
    command_line::exit_code::of_result(done)
}
