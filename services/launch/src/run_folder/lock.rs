//! The lock of a run folder: one run writes into an output at a time.

use super::RunFolderError;
use super::lease::{Candidate, EXPIRES_AFTER, HeldLease, Holder, Look, VALID, Wait, now};
use run::wiring::Wiring;
use rustix::fs::{FlockOperation, OFlags, flock};
use rustix::io::{Errno, FdFlags, fcntl_setfd};
use std::fs::{File, Permissions};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;
use std::time::{Duration, Instant};

/// Longest wait for a supervisor that is just ending.
const ENDING_TIMEOUT: Duration = Duration::from_secs(3);
/// Longest wait for the processes of a killed supervisor. The kernel ends them at once, but freeing gigabytes of memory
/// takes seconds, and many times as long on a busy machine.
const KILLED_TIMEOUT: Duration = Duration::from_mins(1);
/// Interval between two attempts to lock.
const POLL: Duration = Duration::from_millis(10);

/// Interval between two looks at a lease: far below the time of a takeover, and little work for a file server.
const LEASE_POLL: Duration = Duration::from_millis(250);

/// How a run waits for another one that writes into its output.
pub struct Patience<'a> {
    /// Longest wait for a run that is not just ending.
    pub wait: Duration,
    /// Whether the operator has ended the wait.
    pub is_over: &'a mut dyn FnMut() -> bool,
}

/// Locks the file for this process and all processes that it starts. `output` is absolute and without links.
pub fn take(file: &Path, output: &Path, patience: &mut Patience<'_>) -> Result<File, RunFolderError> {
    let lock = open(file).map_err(|source| super::cannot_write(file, source))?;
    let failed = |error: Errno| RunFolderError::Lock { file: file.to_owned(), source: error.into() };
    let begun = Instant::now();
    loop {
        match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => break,
            Err(Errno::WOULDBLOCK) if (patience.is_over)() => {
                return Err(RunFolderError::WaitEnded { output: output.to_owned() });
            }
            Err(Errno::WOULDBLOCK) if begun.elapsed() < timeout(output).max(patience.wait) => std::thread::sleep(POLL),
            Err(Errno::WOULDBLOCK) => return Err(RunFolderError::InUse { output: output.to_owned() }),
            Err(error) => return Err(failed(error)),
        }
    }
    fcntl_setfd(&lock, FdFlags::empty()).map_err(failed)?;
    Ok(lock)
}

/// Waits until no run on another host holds the lease of the output; the lock is held. Changes no file: a run that is refused
/// leaves an output as it is. `folder`: the folder of the leases.
pub fn wait_for_lease(folder: &Path, output: &Path, patience: &mut Patience<'_>) -> Result<Candidate, RunFolderError> {
    let failed = |source| super::cannot_write(folder, source);
    std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder).map_err(failed)?;
    let mut candidate = Candidate::new(folder.to_owned(), Holder::current());
    let begun = Instant::now();
    let mut is_reported = false;
    loop {
        match candidate.look(now()).map_err(failed)? {
            Look::Free { .. } | Look::Expired { .. } => return Ok(candidate),
            Look::Alive(holder) if begun.elapsed() > patience.wait => {
                let (host, pid) = holder.map_or_else(|| ("?".to_owned(), 0), |holder| (holder.host, holder.pid));
                return Err(RunFolderError::InUseElsewhere { output: output.to_owned(), host, pid });
            }
            Look::Alive(_) | Look::Waiting => {}
        }
        if (patience.is_over)() {
            return Err(RunFolderError::WaitEnded { output: output.to_owned() });
        }
        if begun.elapsed() > ENDING_TIMEOUT && !std::mem::replace(&mut is_reported, true) {
            tracing::info!(
                "{}: waiting for the lease of a run on another host; it expires {} s after its last renewal",
                output.display(),
                (EXPIRES_AFTER + VALID).as_secs()
            );
        }
        std::thread::sleep(LEASE_POLL);
    }
}

/// Takes the lease after [`wait_for_lease`].
pub fn take_lease(mut candidate: Candidate, folder: &Path, output: &Path) -> Result<HeldLease, RunFolderError> {
    let failed = |source| super::cannot_write(folder, source);
    loop {
        match candidate.poll(now()).map_err(failed)? {
            Wait::Held(lease) => return HeldLease::new(lease).map_err(failed),
            Wait::Waiting => std::thread::sleep(LEASE_POLL),
            // Another candidate was faster.
            Wait::Alive(holder) => {
                let (host, pid) = holder.map_or_else(|| ("?".to_owned(), 0), |holder| (holder.host, holder.pid));
                return Err(RunFolderError::InUseElsewhere { output: output.to_owned(), host, pid });
            }
        }
    }
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

    fn take(file: &Path, output: &Path) -> Result<File, RunFolderError> {
        super::take(file, output, &mut Patience { wait: Duration::ZERO, is_over: &mut || false })
    }

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
