//! The lease of an output: one run writes into it at a time, also where the output is on a disk that several kernels share.
//!
//! The lock (`flock`) holds within one kernel. Across kernels each supervisor owns a numbered file in `run/leases`, its *epoch*:
//!
//! 1. A supervisor creates the file of the next epoch; the file system lets one of several succeed.
//! 2. The holder rewrites its file every [`RENEW_EVERY`], then looks for a higher epoch. It may write until [`VALID`] after the
//!    start of the last look that found no such epoch; its stages wait when that time has passed.
//! 3. A candidate that sees a foreign file change reports a living holder. It creates the next epoch after the file has not
//!    changed for [`EXPIRES_AFTER`], and begins only [`VALID`] later: by then the old holder has lost its right to write, even if
//!    it was only frozen.
//! 4. A file of the same boot of the same kernel needs no wait: the lock has shown that its processes have ended. A released file
//!    needs none either.
//!
//! Only durations of one clock are compared, so clocks of hosts may differ. Each look first changes the time of the folder: this
//! makes clients of network file systems read the folder anew.

mod renewal;

pub use renewal::{HeldLease, now};

use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions};
use std::io::{Error, ErrorKind, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Interval between two renewals: a file of 200 bytes for each run, which no file server notices.
pub const RENEW_EVERY: Duration = Duration::from_secs(5);
/// Time after a look for which its holder may write: three renewals may be late on a busy file server.
pub const VALID: Duration = Duration::from_secs(20);
/// Time without a renewal after which a lease is taken over: six renewals.
pub const EXPIRES_AFTER: Duration = Duration::from_secs(30);

/// Bytes that a disk writes as a whole.
const SECTOR: usize = 512;

/// The supervisor that holds a lease.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// Name of its host.
    pub host: String,
    /// Identifier of the boot of its kernel.
    pub boot_id: String,
    /// Its process id on its host.
    pub pid: u32,
}

impl Holder {
    /// This process.
    pub fn current() -> Self {
        let read = |name: &str| {
            let text = std::fs::read_to_string(format!("/proc/sys/kernel/{name}")).unwrap_or_default();
            text.trim().to_owned()
        };
        Self { host: read("hostname"), boot_id: read("random/boot_id"), pid: std::process::id() }
    }
}

/// Content of a lease's file.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Record {
    #[serde(flatten)]
    holder: Holder,
    renewals: u64,
    released: bool,
}

/// A lease that was lost.
#[derive(Debug, PartialEq, Eq)]
pub struct Lost {
    /// The file of the run that took it over, or the own file if that was removed.
    pub file: PathBuf,
}

/// State of the wait for a lease.
#[derive(Debug)]
pub enum Wait {
    /// The lease is held.
    Held(Lease),
    /// The time of the earlier holder has not passed yet.
    Waiting,
    /// The earlier holder lives: it has renewed its lease since the first look. `None`: its file was half written.
    Alive(Option<Holder>),
}

/// What a candidate sees.
#[derive(Debug)]
pub enum Look {
    /// The lease may be taken at once.
    Free {
        /// The next epoch.
        epoch: u64,
    },
    /// The holder has not renewed in time: after the next epoch has been created, its right to write still has to end.
    Expired {
        /// The next epoch.
        epoch: u64,
    },
    /// The time of the earlier holder has not passed yet.
    Waiting,
    /// The earlier holder lives, see [`Wait::Alive`].
    Alive(Option<Holder>),
}

/// A supervisor that waits for the lease.
#[derive(Debug)]
pub struct Candidate {
    folder: PathBuf,
    own: Holder,
    observed: Option<Observation>,
    /// The epoch that was created, and when.
    created: Option<Created>,
}

#[derive(Debug)]
struct Observation {
    epoch: u64,
    content: Vec<u8>,
    since: Duration,
    is_alive: bool,
}

#[derive(Clone, Copy, Debug)]
struct Created {
    epoch: u64,
    at: Duration,
}

impl Candidate {
    /// A candidate for the lease in `folder`, which exists.
    pub fn new(folder: PathBuf, own: Holder) -> Self {
        Self { folder, own, observed: None, created: None }
    }

    /// Looks at the lease and takes it if it may. `now`: a clock that never goes back and counts suspended time.
    pub fn poll(&mut self, now: Duration) -> Result<Wait, Error> {
        if let Some(created) = self.created {
            if highest_epoch(&self.folder)? != Some(created.epoch) {
                // Another candidate has waited longer, or somebody has removed the files.
                self.created = None;
                return Ok(Wait::Waiting);
            }
            return if now.saturating_sub(created.at) < VALID {
                Ok(Wait::Waiting)
            } else {
                self.held(created.epoch, now)
            };
        }
        match self.look(now)? {
            Look::Free { epoch } => self.create_and_hold(epoch, now),
            Look::Expired { epoch } => {
                self.observed = None;
                if create(&self.folder, epoch, &self.own)? {
                    self.created = Some(Created { epoch, at: now });
                }
                Ok(Wait::Waiting)
            }
            Look::Waiting => Ok(Wait::Waiting),
            Look::Alive(holder) => Ok(Wait::Alive(holder)),
        }
    }

    /// Looks at the lease and changes no file. `now` as in [`Candidate::poll`].
    pub fn look(&mut self, now: Duration) -> Result<Look, Error> {
        let Some(epoch) = highest_epoch(&self.folder)? else { return Ok(Look::Free { epoch: 1 }) };
        let content = match std::fs::read(lease_file(&self.folder, epoch)) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Look::Waiting),
            content => content?,
        };
        let record = serde_json::from_slice::<Record>(&content).ok();
        if record.as_ref().is_some_and(|record| record.released || record.holder.boot_id == self.own.boot_id) {
            return Ok(Look::Free { epoch: epoch + 1 });
        }
        let holder = record.map(|record| record.holder);
        let is_alive = match &mut self.observed {
            Some(observed) if observed.epoch == epoch && observed.content == content => {
                if now.saturating_sub(observed.since) >= EXPIRES_AFTER {
                    return Ok(Look::Expired { epoch: epoch + 1 });
                }
                observed.is_alive
            }
            observed => {
                let is_alive = observed.is_some();
                *observed = Some(Observation { epoch, content, since: now, is_alive });
                is_alive
            }
        };
        Ok(if is_alive { Look::Alive(holder) } else { Look::Waiting })
    }

    fn create_and_hold(&mut self, epoch: u64, now: Duration) -> Result<Wait, Error> {
        if create(&self.folder, epoch, &self.own)? { self.held(epoch, now) } else { Ok(Wait::Waiting) }
    }

    fn held(&self, epoch: u64, now: Duration) -> Result<Wait, Error> {
        let lease = Lease {
            folder: self.folder.clone(),
            record: Record { holder: self.own.clone(), renewals: 0, released: false },
            epoch,
            looked_at: now,
        };
        for old in epochs(&self.folder)?.into_iter().filter(|old| *old < epoch) {
            // Old files have no effect; the next holder tries again.
            let _ = std::fs::remove_file(lease_file(&self.folder, old));
        }
        Ok(Wait::Held(lease))
    }
}

/// A lease that this process holds.
#[derive(Debug)]
pub struct Lease {
    folder: PathBuf,
    record: Record,
    epoch: u64,
    /// Start of the last look that found no higher epoch.
    looked_at: Duration,
}

impl Lease {
    /// The end of the time in which this process may write, on the clock of [`Lease::renew`].
    pub fn valid_until(&self) -> Duration {
        self.looked_at + VALID
    }

    /// Rewrites the file and looks for a higher epoch. `Err(error)`: the disk does not answer, and the time runs on.
    pub fn renew(&mut self, now: Duration) -> Result<Result<(), Lost>, Error> {
        let file = lease_file(&self.folder, self.epoch);
        let highest = highest_epoch(&self.folder)?;
        if highest != Some(self.epoch) {
            let file = highest.map_or(file, |highest| lease_file(&self.folder, highest));
            return Ok(Err(Lost { file }));
        }
        self.record.renewals += 1;
        rewrite(&file, &self.record)?;
        self.looked_at = now;
        Ok(Ok(()))
    }

    /// Lets the next run begin without a wait.
    pub fn release(mut self) -> Result<(), Error> {
        self.record.released = true;
        rewrite(&lease_file(&self.folder, self.epoch), &self.record)
    }
}

fn lease_file(folder: &Path, epoch: u64) -> PathBuf {
    folder.join(format!("{epoch}.json"))
}

/// Epochs with a file.
fn epochs(folder: &Path) -> Result<Vec<u64>, Error> {
    let mut epochs = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let name = entry?.file_name();
        epochs.extend(name.to_str().and_then(|name| name.strip_suffix(".json")?.parse::<u64>().ok()));
    }
    Ok(epochs)
}

/// The highest epoch, from a folder that network file systems have read anew.
fn highest_epoch(folder: &Path) -> Result<Option<u64>, Error> {
    // A file that comes and goes would do the same, but whoever copies the output of a living run would miss it.
    File::open(folder)?.set_modified(SystemTime::now())?;
    Ok(epochs(folder)?.into_iter().max())
}

/// Creates the file of an epoch. `false` if another supervisor has created it. The file appears with its content, where the file
/// system has links.
fn create(folder: &Path, epoch: u64, own: &Holder) -> Result<bool, Error> {
    let bytes = bytes(&Record { holder: own.clone(), renewals: 0, released: false })?;
    let (file, prepared) = (lease_file(folder, epoch), folder.join(format!("new-{}-{}", own.boot_id, own.pid)));
    write(OpenOptions::new().write(true).create(true).truncate(true), &prepared, &bytes)?;
    let created = match std::fs::hard_link(&prepared, &file) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => {
            write(OpenOptions::new().write(true).create_new(true), &file, &bytes)
        }
        linked => linked,
    };
    std::fs::remove_file(&prepared)?;
    match created {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(false),
        created => created.and_then(|()| File::open(folder)?.sync_all()).map(|()| true),
    }
}

/// Rewrites a file in place: other hosts check the content of a file when they open it, but may keep old names for a minute.
fn rewrite(file: &Path, record: &Record) -> Result<(), Error> {
    write(OpenOptions::new().write(true), file, &bytes(record)?)
}

fn write(options: &mut OpenOptions, file: &Path, bytes: &[u8]) -> Result<(), Error> {
    let mut file = options.mode(0o600).open(file)?;
    file.write_all(bytes)?;
    file.sync_all()
}

/// Content of a file: always whole sectors, which disks replace as a whole.
fn bytes(record: &Record) -> Result<Vec<u8>, Error> {
    let mut bytes = serde_json::to_vec(record)?;
    bytes.resize(bytes.len().next_multiple_of(SECTOR), b' ');
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn s(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    fn on(host: &str) -> Holder {
        Holder { host: host.to_owned(), boot_id: format!("boot of {host}"), pid: 7 }
    }

    fn candidate(folder: &tempfile::TempDir, host: &str) -> Candidate {
        Candidate::new(folder.path().to_owned(), on(host))
    }

    fn held(wait: Wait) -> Lease {
        match wait {
            Wait::Held(lease) => lease,
            other => panic!("{other:?}"),
        }
    }

    fn holding(folder: &tempfile::TempDir, host: &str, now: Duration) -> Lease {
        held(candidate(folder, host).poll(now).expect("a disk"))
    }

    #[test]
    fn dead_holder_on_another_kernel_is_replaced_after_its_time() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut old = holding(&folder, "a", s(100));
        // The clock of the other host shows another time.
        let mut candidate = candidate(&folder, "b");
        let waits = |candidate: &mut Candidate, now| matches!(candidate.poll(now), Ok(Wait::Waiting));
        for now in [5000, 5010, 5029, 5030, 5031, 5049] {
            assert!(waits(&mut candidate, s(now)), "{now}");
        }
        let mut new = held(candidate.poll(s(5050)).expect("a disk"));
        assert_eq!(new.renew(s(5051)).expect("a disk"), Ok(()));
        // The old one was frozen: its time has passed, and its next look ends it.
        let lost = old.renew(s(160)).expect("a disk").expect_err("is lost");
        assert_eq!(lost.file, folder.path().join("2.json"));
        assert_eq!(new.renew(s(5056)).expect("a disk"), Ok(()), "the late look of the old holder changes nothing");
    }

    #[test]
    fn no_two_holders_may_write_at_the_same_time() {
        // The old holder renews for the last time at each possible moment of the takeover.
        for last in 0..90 {
            let folder = tempfile::tempdir().expect("a folder");
            let mut old = holding(&folder, "a", s(0));
            let mut candidate = candidate(&folder, "b");
            let mut begun = None;
            for now in 0..120 {
                if now == last {
                    let _ = old.renew(s(now)).expect("a disk");
                }
                if let Wait::Held(lease) = candidate.poll(s(now)).expect("a disk") {
                    begun = Some((now, lease));
                    break;
                }
            }
            let (begun, _lease) = begun.unwrap_or_else(|| panic!("renewed at {last}: no takeover"));
            assert!(old.valid_until() <= s(begun), "renewed at {last}: {:?} > {begun} s", old.valid_until());
        }
    }

    #[test]
    fn living_holder_is_named_and_never_replaced() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut old = holding(&folder, "a", s(0));
        let mut candidate = candidate(&folder, "b");
        assert!(matches!(candidate.poll(s(0)), Ok(Wait::Waiting)));
        for now in (5..500).step_by(5) {
            assert_eq!(old.renew(s(now)).expect("a disk"), Ok(()));
            match candidate.poll(s(now + 1)).expect("a disk") {
                Wait::Alive(holder) => assert_eq!(holder, Some(on("a"))),
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn released_lease_and_one_of_the_same_kernel_are_taken_at_once() {
        let folder = tempfile::tempdir().expect("a folder");
        holding(&folder, "a", s(0)).release().expect("a disk");
        let _killed = holding(&folder, "b", s(0));
        let mut again = candidate(&folder, "b");
        again.own.pid = 8;
        let lease = held(again.poll(s(1)).expect("a disk"));
        assert_eq!(epochs(folder.path()).expect("a folder"), [lease.epoch], "old files are removed");
    }

    #[test]
    fn look_changes_no_file() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(matches!(candidate(&folder, "b").look(s(0)), Ok(Look::Free { epoch: 1 })));
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
        let _dead = holding(&folder, "a", s(0));
        let mut candidate = candidate(&folder, "b");
        assert!(matches!(candidate.look(s(0)), Ok(Look::Waiting)));
        assert!(matches!(candidate.look(s(30)), Ok(Look::Expired { epoch: 2 })));
        assert_eq!(epochs(folder.path()).expect("a folder"), [1]);
        assert!(matches!(candidate.poll(s(31)), Ok(Wait::Waiting)), "it knows already that the lease has expired");
        assert!(matches!(candidate.poll(s(51)), Ok(Wait::Held(_))));
    }

    #[test]
    fn one_of_two_candidates_wins() {
        let folder = tempfile::tempdir().expect("a folder");
        let _dead = holding(&folder, "a", s(0));
        let mut candidates = [candidate(&folder, "b"), candidate(&folder, "c")];
        let mut n_held = 0;
        for now in 0..200 {
            for candidate in &mut candidates {
                n_held += u32::from(matches!(candidate.poll(s(now)), Ok(Wait::Held(_))));
            }
            if n_held > 0 {
                break;
            }
        }
        assert_eq!(n_held, 1);
    }

    #[test]
    fn half_written_file_expires_and_a_removed_one_is_lost() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("3.json"), "{\"host\":\"a\"").expect("written");
        let mut candidate = candidate(&folder, "b");
        let takeover = (0..200).find_map(|now| match candidate.poll(s(now)).expect("a disk") {
            Wait::Held(lease) => Some((now, lease)),
            _ => None,
        });
        let (now, mut lease) = takeover.expect("it expires");
        assert_eq!((now, lease.epoch), (50, 4));
        std::fs::remove_file(folder.path().join("4.json")).expect("removed");
        assert!(lease.renew(s(60)).expect("a disk").is_err());
    }
}
