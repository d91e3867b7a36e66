//! `replica`: what surrounds a run. Data goes to stdout, talk to stderr.
//!
//! Exit codes: 0 done, 1 failed, 2 usage, 3 done but with data lost.

mod commands;

use clap::Parser;
use std::process::ExitCode;

/// Tools around `replica-launch`.
#[derive(Parser)]
#[command(name = "replica", version)]
enum Cli {
    /// One point cloud per revolution out of a packet capture.
    Convert(commands::convert::Args),
    /// Turn a public data set's layout into a drive folder, with links instead of copies.
    Import(commands::import::Args),
    /// Make a drive of a procedural street.
    Simulate(commands::simulate::Args),
    /// Look into a file or folder.
    Inspect(commands::inspect::Args),
}

fn main() -> ExitCode {
    let done = match Cli::parse() {
        Cli::Convert(args) => commands::convert::run(&args),
        Cli::Import(args) => commands::import::run(&args),
        Cli::Simulate(args) => commands::simulate::run(&args).map(|()| ExitCode::SUCCESS),
        Cli::Inspect(args) => commands::inspect::run(&args).map(|()| ExitCode::SUCCESS),
    };
    done.unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}
