//! Exit codes of the commands. The help of each program lists them.

use crate::error_text::error_text;
use crate::say_error;
use crate::usage_error::UsageError;
use std::process::ExitCode;

/// The result is incomplete, or the comparison found differences; the help of each command states the case.
pub const INCOMPLETE: u8 = run::exit::INCOMPLETE;

/// The exit code of a command that failed.
fn from_error(error: &anyhow::Error) -> ExitCode {
    // clap checks arguments that are wrong for every run. Arguments that are wrong for this run get the same exit code.
    if error.is::<UsageError>() { ExitCode::from(run::exit::USAGE) } else { ExitCode::FAILURE }
}

/// The exit code of a command that has ended. Prints its error to stderr.
pub fn from_result(done: anyhow::Result<ExitCode>) -> ExitCode {
    done.unwrap_or_else(|error| {
        say_error!("error: {}", error_text(&error));
        from_error(&error)
    })
}
