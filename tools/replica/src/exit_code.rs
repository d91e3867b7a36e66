//! Exit codes of the commands. They are listed in the help of `replica`.

use crate::usage_error::UsageError;
use std::process::ExitCode;

/// The result is incomplete, or what was compared differs; the help of each command says which.
pub const INCOMPLETE: u8 = run::exit::INCOMPLETE;

/// The exit code of a command that failed.
pub fn of_error(error: &anyhow::Error) -> ExitCode {
    // clap checks arguments that are wrong for every run. Arguments that are wrong for this run get the same exit code.
    if error.is::<UsageError>() { ExitCode::from(run::exit::USAGE) } else { ExitCode::FAILURE }
}
