//! Runs `replica-lab`, reads what it prints, and simulates drives.

use simulation::{DriveSpec, write_drive};
use std::path::Path;
use std::process::{Command, Output};

/// Runs `replica-lab` with these arguments.
pub fn replica_lab(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_replica-lab")).args(arguments).output().expect("starts")
}

/// stdout followed by stderr.
pub fn printed(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned()
}

/// Output of a successful command.
pub fn succeeded(output: &Output) -> String {
    assert!(output.status.success(), "{}: {}", output.status, printed(output));
    printed(output)
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// Writes a simulated drive.
pub fn simulate(spec: &DriveSpec, drive: &Path) {
    write_drive(spec, drive, &mut |_| {}).expect("is simulated");
}
