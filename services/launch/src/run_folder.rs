//! `<output>/run/`: what a run keeps about itself.
//!
//! | file | content |
//! |---|---|
//! | `lock` | held by the supervisor of the run |
//! | `launch.toml`, `settings.json` | what was asked for, what it came to |
//! | `wiring.json` | what those who look on need to know ([`Wiring`]) |
//! | `<stage>.json` | what the stage was told |
//! | `logs/<stage>.log` | what it said |
//! | `costs.csv` | what each stage had done and cost by then, a line a second; not live ([`crate::costs`]) |
//! | `swaps.json` | what was swapped since ([`SwapRecord`]) |
//! | `states/<barrier>/<stage>.state` | what it needs to go on from there |
//!
//! A kill at any moment leaves a folder from which `--resume` goes on: `settings.json` is the last file of a beginning and the
//! first to go with the next, and every file that is read again is there whole or not at all.

use crate::plan::{Plan, PlannedStage};
use crate::swap_record::SwapRecord;
use formats::atomic_file::write_atomic;
use ipc::{Domain, IpcError};
use messages::pod::{FINGERPRINT_START, fingerprint};
use rustix::fs::{FlockOperation, flock};
use rustix::io::{Errno, FdFlags, fcntl_setfd};
use stage::assignment::{Assignment, Restart, state_file};
use stage::verify_state;
use stage::wiring::Wiring;
use std::fs::File;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A supervisor that is just ending has this long.
const LOCK_PATIENCE: Duration = Duration::from_secs(3);
/// The processes of a supervisor that was killed have this long: the kernel ends them at once, but to free gigabytes takes it a
/// while, and a busy machine many times as long.
const DYING_PATIENCE: Duration = Duration::from_mins(1);

/// File of the run's settings as resolved.
const SETTINGS: &str = "settings.json";
/// Copy of the launch file.
const LAUNCH_FILE: &str = "launch.toml";
/// File of the run's swaps.
const SWAPS: &str = "swaps.json";

/// The folder, locked for this supervisor alone.
pub struct RunFolder {
    folder: PathBuf,
    output: PathBuf,
    _lock: File,
}

impl RunFolder {
    /// Creates and locks the folder under `output`. Whatever this process starts inherits the lock: it is free only when a
    /// run's last process is gone, so that none of them writes into the next run.
    pub fn lock(output: &Path) -> Result<Self, String> {
        let folder = output.join("run");
        std::fs::create_dir_all(&folder).map_err(|error| cannot_write(&folder, &error))?;
        let path = folder.join("lock");
        let lock = File::create(&path).map_err(|error| cannot_write(&path, &error))?;
        // One folder has one name from here on, however it was given.
        let output = output.canonicalize().map_err(|error| format!("{}: {error}", output.display()))?;
        let begun = Instant::now();
        loop {
            match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
                Ok(()) => break,
                Err(Errno::WOULDBLOCK) if begun.elapsed() < patience_with(&output) => {
                    std::thread::sleep(Duration::from_millis(10));
                }
                Err(Errno::WOULDBLOCK) => return Err(format!("{}: another run is writing here", output.display())),
                Err(other) => return Err(format!("{}: cannot be locked: {other}", path.display())),
            }
        }
        fcntl_setfd(&lock, FdFlags::empty()).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(Self { folder, output, _lock: lock })
    }

    /// The run's own world in shared memory.
    pub fn domain(&self) -> Result<Domain, String> {
        domain_of(&self.output).map_err(|error| error.to_string())
    }

    /// Forgets the states and logs of an earlier run.
    pub fn begin(&self, plan: &Plan) -> Result<(), String> {
        remove_file(&self.folder.join(SETTINGS))?;
        let logs = self.folder.join("logs");
        for folder in [&self.states(), &logs] {
            if folder.exists() {
                std::fs::remove_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
            }
        }
        std::fs::create_dir(&logs).map_err(|error| cannot_write(&logs, &error))?;
        self.forget_summary()?;
        remove_file(&self.costs())?;
        self.write_swaps(&SwapRecord::default())?;
        let launch_file =
            std::fs::read(&plan.launch_file).map_err(|error| format!("{}: {error}", plan.launch_file.display()))?;
        self.write(LAUNCH_FILE, &launch_file)?;
        self.write(SETTINGS, settings(plan).to_string().as_bytes())
    }

    /// Whether a run was begun here; if not, there is nothing to resume.
    pub fn has_begun(&self) -> bool {
        self.folder.join(SETTINGS).exists()
    }

    /// Makes sure that `plan` is that of the run that was begun here: another would not go on with its bytes.
    pub fn resume(&self, plan: &Plan) -> Result<(), String> {
        let path = self.folder.join(SETTINGS);
        let begun = std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let begun: serde_json::Value =
            serde_json::from_slice(&begun).map_err(|error| format!("{}: {error}", path.display()))?;
        let same_file = std::fs::read(&plan.launch_file).ok() == std::fs::read(self.launch_copy()).ok();
        if !same_file || begun != settings(plan) {
            return Err(format!(
                "the run in {} was begun with other settings or programs: it cannot be resumed with these",
                self.output.display()
            ));
        }
        self.forget_summary()
    }

    /// A summary is that of a finished run; until then there is none.
    fn forget_summary(&self) -> Result<(), String> {
        remove_file(&self.output.join("summary.json"))
    }

    /// What the stages read, so that an edit during the run does not show in it.
    pub fn launch_copy(&self) -> PathBuf {
        self.folder.join(LAUNCH_FILE)
    }

    /// See [`crate::costs`].
    pub fn costs(&self) -> PathBuf {
        self.folder.join("costs.csv")
    }

    fn states(&self) -> PathBuf {
        self.folder.join("states")
    }

    /// The stage's log. Every attempt appends to it.
    pub fn log(&self, stage: &str) -> PathBuf {
        self.folder.join("logs").join(format!("{stage}.log"))
    }

    /// Writes what the stage is told; returns the file.
    pub fn assign(
        &self,
        plan: &Plan,
        stage: &PlannedStage,
        domain: &Domain,
        resume: Option<u64>,
        restart: Option<Restart>,
    ) -> Result<PathBuf, String> {
        let assignment = Assignment {
            stage: stage.name.clone(),
            domain: domain.name().to_owned(),
            supervisor: std::process::id(),
            context: plan.context.clone(),
            launch_file: self.launch_copy(),
            overrides: plan.overrides.clone(),
            inputs: stage.inputs.clone(),
            outputs: stage.outputs.clone(),
            barrier_s: plan.run.barrier_s,
            states: self.states(),
            resume,
            restart,
        };
        let text = serde_json::to_vec_pretty(&assignment).map_err(|error| error.to_string())?;
        let name = format!("{}.json", stage.name);
        self.write(&name, &text)?;
        Ok(self.folder.join(name))
    }

    /// Writes what those who look on need to know. Whole or not at all: they read at any moment.
    pub fn write_wiring(&self, wiring: &Wiring) -> Result<(), String> {
        let text = serde_json::to_vec_pretty(wiring).map_err(|error| error.to_string())?;
        self.write("wiring.json", &text)
    }

    /// Writes which swaps hold. On the disk when it returns: what the stages do next depends on it.
    pub fn write_swaps(&self, record: &SwapRecord) -> Result<(), String> {
        let text = serde_json::to_vec_pretty(record).map_err(|error| error.to_string())?;
        self.write(SWAPS, &text)
    }

    /// What [`RunFolder::write_swaps`] wrote last.
    pub fn read_swaps(&self) -> Result<SwapRecord, String> {
        let path = self.folder.join(SWAPS);
        let text = std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        serde_json::from_slice(&text).map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Bytes that the stage itself saved at the barrier; 0 if they cannot be counted.
    pub fn state_bytes(&self, barrier: u64, stage: &str) -> u64 {
        stage::saved_bytes(&state_file(&self.states(), barrier, stage)).unwrap_or_default()
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), String> {
        let path = self.folder.join(name);
        write_atomic(&path, bytes).map_err(|error| cannot_write(&path, &error))
    }

    /// The last barrier of which every stage has its state on disk, whole. A barrier that is passed over is said, with its
    /// first file that is not whole.
    pub fn last_whole_barrier(&self, stages: &[PlannedStage], mut say: impl FnMut(&str)) -> Option<u64> {
        let mut barriers = self.barriers();
        barriers.sort_unstable();
        barriers.into_iter().rev().find(|barrier| {
            let torn = stages.iter().find_map(|stage| {
                let path = state_file(&self.states(), *barrier, &stage.name);
                verify_state(&path).err().map(|error| format!("{}: {error}", path.display()))
            });
            if let Some(torn) = &torn {
                say(&format!("barrier {barrier} is passed over: {torn}"));
            }
            torn.is_none()
        })
    }

    /// The last barrier of which this stage has its state on disk, whole.
    pub fn last_barrier_of(&self, stage: &str) -> Option<u64> {
        let is_whole = |barrier: &u64| verify_state(&state_file(&self.states(), *barrier, stage)).is_ok();
        self.barriers().into_iter().filter(is_whole).max()
    }

    /// Removes the states of all barriers before this one.
    pub fn forget_before(&self, barrier: u64) {
        for old in self.barriers().into_iter().filter(|old| *old < barrier) {
            // What cannot be removed now is removed with the next barrier or the next run.
            let _ = std::fs::remove_dir_all(self.states().join(old.to_string()));
        }
    }

    /// Removes states behind `barrier` (None: all). They are of an attempt that did not come to its next complete barrier, or
    /// of a swap that was undone, and must not be mixed with those that will be saved under the same numbers.
    pub fn forget_after(&self, barrier: Option<u64>) -> Result<(), String> {
        for late in self.barriers().into_iter().filter(|late| barrier.is_none_or(|barrier| *late > barrier)) {
            let folder = self.states().join(late.to_string());
            std::fs::remove_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        }
        Ok(())
    }

    fn barriers(&self) -> Vec<u64> {
        let entries = std::fs::read_dir(self.states()).into_iter().flatten().flatten();
        entries.filter_map(|entry| entry.file_name().to_string_lossy().parse().ok()).collect()
    }
}

/// How long to wait for those who hold the lock of the run into `output`. Without a supervisor they are dying.
fn patience_with(output: &Path) -> Duration {
    let is_dying = Wiring::read(output).is_ok_and(|wiring| !wiring.is_alive(output));
    if is_dying { DYING_PATIENCE } else { LOCK_PATIENCE }
}

fn remove_file(path: &Path) -> Result<(), String> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(cannot_write(path, &error)),
        _ => Ok(()),
    }
}

fn cannot_write(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}: cannot be written; is [run] output right?", path.display())
}

/// What the launch file and the command line came to.
fn settings(plan: &Plan) -> serde_json::Value {
    serde_json::json!({
        "launch_file": plan.launch_file,
        "overrides": plan.overrides,
        "run": plan.run,
        "context": plan.context,
        "stages": plan.stages.iter().map(|s| serde_json::json!({
            "name": s.name, "program": s.program, "settings": s.description.settings,
        })).collect::<Vec<_>>(),
    })
}

/// The domain of runs into `output` (absolute, links resolved). The same output has the same, so the next run finds what a
/// dead one left.
pub fn domain_of(output: &Path) -> Result<Domain, IpcError> {
    let digest = fingerprint(FINGERPRINT_START, output.as_os_str().as_bytes());
    Domain::new(&format!("{digest:016x}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use stage::Mode;

    #[test]
    fn processes_of_a_dead_supervisor_are_waited_for_longer_than_a_run_that_goes_on() {
        let output = tempfile::tempdir().expect("a folder");
        let output = output.path().canonicalize().expect("a path");
        assert_eq!(patience_with(&output), LOCK_PATIENCE, "nobody has said anything of a run");
        std::fs::create_dir(output.join("run")).expect("a folder");
        let wired_by = |supervisor: u32| {
            let wiring =
                Wiring { domain: String::new(), supervisor, attempt: 0, mode: Mode::Offline, stages: Vec::new() };
            std::fs::write(Wiring::file(&output), serde_json::to_vec(&wiring).expect("JSON")).expect("written");
        };
        let _lock = File::create(output.join("run/lock")).expect("a file");
        wired_by(std::process::id());
        assert_eq!(patience_with(&output), LOCK_PATIENCE, "it has the lock open");
        let mut dead = std::process::Command::new("true").spawn().expect("starts");
        dead.wait().expect("ends");
        wired_by(dead.id());
        assert_eq!(patience_with(&output), DYING_PATIENCE);
    }
}
