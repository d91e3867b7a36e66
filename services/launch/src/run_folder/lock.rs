//! The lock of a run folder: one run writes into an output at a time.

use super::RunFolderError;
use run::wiring::Wiring;
use rustix::fs::{FlockOperation, OFlags, flock};
use rustix::io::{Errno, FdFlags, fcntl_setfd};
use std::fs::{File, Permissions};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;
use std::time::{Duration, Instant};

/// Longest wait for a supervisor that is just ending.
const ENDING_TIMEOUT: Duration = Duration::from_secs(3);
/// Longest wait for the processes of a killed supervisor. The kernel ends them at once, but freeing gigabytes of memory
/// takes seconds, and many times as long on a busy machine.
const KILLED_TIMEOUT: Duration = Duration::from_mins(1);
/// Interval between two attempts to lock.
const POLL: Duration = Duration::from_millis(10);

/// Locks the file for this process and all processes that it starts. `output` is absolute and without links.
pub fn take(file: &Path, output: &Path) -> Result<File, RunFolderError> {
    let lock = open(file).map_err(|source| super::cannot_write(file, source))?;
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

/// Opens the lock. Another user with read access could also lock it, and a link could lead to a foreign file.
fn open(file: &Path) -> std::io::Result<File> {
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    let lock = File::options()
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .custom_flags(flags.bits() as i32)
        .open(file)?;
    let metadata = lock.metadata()?;
    if !metadata.is_file() {
        return Err(std::io::Error::other("is not a file"));
    }
    if metadata.mode() & 0o077 != 0 {
        // On file systems without modes this has no effect or fails.
        let _ = lock.set_permissions(Permissions::from_mode(0o600));
    }
    Ok(lock)
}

/// The time to wait for the processes that hold the lock of the run into `output`.
fn timeout(output: &Path) -> Duration {
    let is_killed = Wiring::read(output).is_ok_and(|wiring| !wiring.is_alive(output));
    if is_killed { KILLED_TIMEOUT } else { ENDING_TIMEOUT }
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::Mode;

    #[test]
    fn lock_follows_no_link_and_is_not_readable_by_others() {
        let output = tempfile::tempdir().expect("a folder");
        let file = output.path().join("lock");
        let target = output.path().join("target");
        std::fs::write(&target, "of somebody").expect("written");
        std::os::unix::fs::symlink(&target, &file).expect("linked");
        assert!(take(&file, output.path()).is_err(), "a link");
        assert_eq!(std::fs::read(&target).expect("there"), b"of somebody");
        std::fs::remove_file(&file).expect("removed");
        std::fs::write(&file, "").expect("written");
        std::fs::set_permissions(&file, Permissions::from_mode(0o644)).expect("set");
        let _lock = take(&file, output.path()).expect("taken");
        assert_eq!(std::fs::metadata(&file).expect("there").mode() & 0o777, 0o600);
    }

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
