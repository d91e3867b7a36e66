//! `replica`: the operator's command line next to `replica-launch`.
//!
//! It controls runs (`status`, `echo`, `record`, `swap`, `batch`, ...), handles data (`import`, `inspect`, `rig`, `deliver`, `view`,
//! `report`, ...) and checks the machine (`doctor`). Training, scores and analysis are in `replica-lab`.
//!
//! | module | commands |
//! |---|---|
//! | `control` | observe, record, replay or change a run |
//! | `data` | drives, clouds, recordings and finished runs as files |
//! | `setup` | this machine, shells, new stages |
//!
//! It must never change the result of a run by observing it, link a network or a trainer (a plain `cargo build` stays small),
//! or print anything but the answer to stdout; diagnostics go to stderr.
//!
//! Start reading at `cli`, which lists the commands; a command is a file with its `Args` and a function `run`. Output, arguments,
//! exit codes and Ctrl-C are in the library `command_line`, pictures of clouds in `pictures`.

mod byte_values;
mod cli;
mod control;
mod data;
mod setup;

use std::process::ExitCode;

fn main() -> ExitCode {
    run::process::with_enough_stack(run_command)
}

fn run_command() -> ExitCode {
    command_line::threads::bound();
    let done = cli::parse().map_err(anyhow::Error::from).and_then(cli::Parsed::run);
    command_line::exit_code::from_result(done)
}
