//! Ctrl-C, lines on stdout and stderr, and a stdout that its reader has closed.

use run::terminal::printable;
use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Set by SIGINT (Ctrl-C) or SIGTERM.
#[derive(Clone)]
pub struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// The first signal sets the flag. The second signal ends the process immediately, with this exit code.
    pub fn register(exit_code: u8) -> std::io::Result<Self> {
        let flag = Arc::new(AtomicBool::new(false));
        for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
            // The order matters: the first signal must find the flag unset.
            signal_hook::flag::register_conditional_shutdown(signal, i32::from(exit_code), Arc::clone(&flag))?;
            signal_hook::flag::register(signal, Arc::clone(&flag))?;
        }
        Ok(Self(flag))
    }

    /// Whether a signal was received.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Prints a line to stdout, like `println!`. A closed stdout is not an error, and the command continues its work.
#[macro_export]
macro_rules! say {
    ($($line:tt)*) => { $crate::terminal::print_line(format_args!($($line)*)) };
}

/// See [`say`].
pub fn print_line(line: Arguments<'_>) -> io::Result<()> {
    match writeln!(io::stdout(), "{}", printable(&line.to_string())) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        printed => printed,
    }
}

/// Prints a line to stderr, like `eprintln!`: warnings, errors, progress.
#[macro_export]
macro_rules! say_error {
    ($($line:tt)*) => { $crate::terminal::print_error_line(format_args!($($line)*)) };
}

/// See [`say_error`].
pub fn print_error_line(line: Arguments<'_>) {
    // Without stderr, the line is lost.
    let _ = writeln!(io::stderr(), "{}", printable(&line.to_string()));
}

/// Turns a closed stdout into success: the reader of the pipe (for example `head`) needs no more.
pub fn ignore_broken_pipe(result: anyhow::Result<()>) -> anyhow::Result<ExitCode> {
    match result {
        Err(error) if !is_broken_pipe(&error) => Err(error),
        _ => Ok(ExitCode::SUCCESS),
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let mut causes = error.chain().filter_map(|cause| cause.downcast_ref::<std::io::Error>());
    causes.any(|cause| cause.kind() == ErrorKind::BrokenPipe)
}
