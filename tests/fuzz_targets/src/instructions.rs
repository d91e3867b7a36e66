//! Instructions of a process under valgrind: a count that is repeatable whatever else the machine does, unlike a time.

use std::io;
use std::process::Command;

/// Instructions that this program executes with `arguments`, its start included.
///
/// # Errors
/// Valgrind is not installed, or the program fails.
pub fn instructions(arguments: &[&str]) -> io::Result<u64> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(std::env::current_exe()?)
        .args(arguments)
        .output()
        .map_err(|error| io::Error::other(format!("valgrind does not start ({error}): apt-get install valgrind")))?;
    let text = String::from_utf8_lossy(&output.stderr);
    let count = text.lines().find_map(|line| line.split_once("Collected : ")?.1.trim().parse().ok());
    count.filter(|_| output.status.success()).ok_or_else(|| {
        io::Error::other(format!("{arguments:?} under valgrind: {}, no count of instructions: {text}", output.status))
    })
}
