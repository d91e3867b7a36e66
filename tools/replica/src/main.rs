//! `replica`: what surrounds a run. Data goes to stdout, talk to stderr.
//!
//! Exit codes: 0 done, 1 failed, 2 usage, 3 done but with data lost, 78 bad configuration.

mod attach;
mod byte_values;
mod commands;
mod figures;
mod terminal;

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
    /// Play a packet capture back to a host, as the sensor sent it.
    Send(commands::send::Args),
    /// Make a drive through a procedural town.
    Simulate(commands::simulate::Args),
    /// Train a model that gives points their classes.
    Train(commands::train::Args),
    /// Record topics of a running pipeline.
    Record(commands::record::Args),
    /// Run a launch file on a recording.
    Replay(commands::replay::Args),
    /// Tell where two recordings differ.
    Compare(commands::compare::Args),
    /// Look into a file or folder.
    Inspect(commands::inspect::Args),
    /// Hold a result against the truth.
    Evaluate(commands::evaluate::Args),
    /// List the objects of a run's clouds.
    Instances(commands::instances::Args),
    /// Raw mosaics into ENVI cubes.
    Cube(commands::cube::Args),
    /// Statistics and diagnosis of reflectances.
    Spectrum(commands::spectrum::Args),
    /// Measure a pipeline, and what it would cost if messages were copied.
    Bench(commands::bench::Args),
    /// What the stages and topics of a running pipeline are doing.
    Status(commands::status::Args),
    /// The topics of a run.
    Topics(commands::topics::Args),
    /// The messages of a topic of a running pipeline.
    Echo(commands::echo::Args),
    /// How often messages of a topic come, and how evenly.
    Hz(commands::hz::Args),
    /// Replace a stage of a running pipeline.
    Swap(commands::swap::Args),
    /// End a running pipeline.
    Stop(commands::stop::Args),
}

fn main() -> ExitCode {
    let done = match Cli::parse() {
        Cli::Convert(args) => commands::convert::run(&args),
        Cli::Import(args) => commands::import::run(&args),
        Cli::Send(args) => commands::send::run(&args).map(|()| ExitCode::SUCCESS),
        Cli::Simulate(args) => commands::simulate::run(&args),
        Cli::Train(args) => commands::train::run(&args).map(|()| ExitCode::SUCCESS),
        Cli::Record(args) => commands::record::run(&args),
        Cli::Replay(args) => commands::replay::run(&args),
        Cli::Compare(args) => commands::compare::run(&args),
        Cli::Inspect(args) => commands::inspect::run(&args),
        Cli::Evaluate(args) => commands::evaluate::run(&args),
        Cli::Instances(args) => commands::instances::run(&args),
        Cli::Cube(args) => commands::cube::run(&args),
        Cli::Spectrum(args) => commands::spectrum::run(&args),
        Cli::Bench(args) => commands::bench::run(&args),
        Cli::Status(args) => terminal::quietly(commands::status::run(&args)),
        Cli::Topics(args) => terminal::quietly(commands::topics::run(&args)),
        Cli::Echo(args) => terminal::quietly(commands::echo::run(&args)),
        Cli::Hz(args) => terminal::quietly(commands::hz::run(&args)),
        Cli::Swap(args) => commands::swap::run(&args),
        Cli::Stop(args) => commands::stop::run(&args),
    };
    done.unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        // Words that make no sense for the run that they name are as wrong as those that clap refuses.
        if error.is::<attach::Usage>() { ExitCode::from(stage::exit::USAGE) } else { ExitCode::FAILURE }
    })
}
