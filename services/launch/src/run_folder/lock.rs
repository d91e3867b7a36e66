//! The lock of a run folder: one run writes into an output at a time.

use super::RunFolderError;
use run::wiring::Wiring;
use rustix::fs::{FlockOperation, flock};
use rustix::io::{Errno, FdFlags, fcntl_setfd};
use std::fs::File;
use std::path::Path;
use std::time::{Duration, Instant};

/// For a supervisor that is just ending.
const ENDING_TIMEOUT: Duration = Duration::from_secs(3);
/// For the processes of a killed supervisor. The kernel ends them at once, but freeing gigabytes of memory takes seconds, and
/// many times as long on a busy machine.
const KILLED_TIMEOUT: Duration = Duration::from_mins(1);
/// Between two attempts.
const POLL: Duration = Duration::from_millis(10);

/// Locks the file for this process and for all that it starts. `output` is absolute and without links.
pub fn take(file: &Path, output: &Path) -> Result<File, RunFolderError> {
    let lock = File::create(file).map_err(|source| super::cannot_write(file, source))?;
    let failed = |error: Errno| RunFolderError::Lock { file: file.to_owned(), source: error.into() };
    let begun = Instant::now();
    loop {
        match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => break,
            Err(Errno::WOULDBLOCK) if begun.elapsed() < timeout(output) => std::thread::sleep(POLL),
            Err(Errno::WOULDBLOCK) => return Err(RunFolderError::InUse { output: output.to_owned() }),
            Err(error) => return Err(failed(error)),
        }
    }
    fcntl_setfd(&lock, FdFlags::empty()).map_err(failed)?;
    Ok(lock)
}

/// How long to wait for the processes that hold the lock of the run into `output`.
fn timeout(output: &Path) -> Duration {
    let is_killed = Wiring::read(output).is_ok_and(|wiring| !wiring.is_alive(output));
    if is_killed { KILLED_TIMEOUT } else { ENDING_TIMEOUT }
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::Mode;

    #[test]
    fn processes_of_a_killed_supervisor_get_more_time_than_a_running_one() {
        let output = tempfile::tempdir().expect("a folder");
        let output = output.path().canonicalize().expect("a path");
        assert_eq!(timeout(&output), ENDING_TIMEOUT, "no run was here");
        std::fs::create_dir(output.join("run")).expect("a folder");
        let wired_by = |supervisor: u32| {
            let wiring =
                Wiring { domain: String::new(), supervisor, attempt: 0, mode: Mode::Offline, stages: Vec::new() };
            std::fs::write(Wiring::file(&output), serde_json::to_vec(&wiring).expect("JSON")).expect("written");
        };
        let _lock = File::create(output.join("run/lock")).expect("a file");
        wired_by(std::process::id());
        assert_eq!(timeout(&output), ENDING_TIMEOUT, "it has the lock open");
        let mut dead = std::process::Command::new("true").spawn().expect("starts");
        dead.wait().expect("ends");
        wired_by(dead.id());
        assert_eq!(timeout(&output), KILLED_TIMEOUT);
    }
}
