//! `<output>/run/`: what a run keeps about itself.
//!
//! | file | content |
//! |---|---|
//! | `lock` | held by the supervisor of the run |
//! | `launch.toml`, `settings.json` | what was asked for, what it came to |
//! | `<stage>.json` | what the stage was told |
//! | `logs/<stage>.log` | what it said |
//! | `states/<barrier>/<stage>.state` | what it needs to go on from there |

use crate::plan::{Plan, PlannedStage};
use ipc::{Domain, IpcError};
use messages::pod::{FINGERPRINT_START, fingerprint};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use stage::assignment::Assignment;
use std::fs::File;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// File of the run's settings as resolved.
const SETTINGS: &str = "settings.json";

/// The folder, locked for this supervisor alone.
pub struct RunFolder {
    folder: PathBuf,
    output: PathBuf,
    _lock: File,
}

impl RunFolder {
    /// Creates and locks the folder under `output`.
    pub fn lock(output: &Path) -> Result<Self, String> {
        let folder = output.join("run");
        std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        let path = folder.join("lock");
        let lock = File::create(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        flock(&lock, FlockOperation::NonBlockingLockExclusive).map_err(|error| match error {
            Errno::WOULDBLOCK => format!("{}: another run is writing here", output.display()),
            other => format!("{}: cannot be locked: {other}", path.display()),
        })?;
        // One folder has one name from here on, however it was given.
        let output = output.canonicalize().map_err(|error| format!("{}: {error}", output.display()))?;
        Ok(Self { folder, output, _lock: lock })
    }

    /// The run's own world in shared memory.
    pub fn domain(&self) -> Result<Domain, String> {
        domain_of(&self.output).map_err(|error| error.to_string())
    }

    /// Forgets the states and logs of an earlier run.
    pub fn begin(&self, plan: &Plan) -> Result<(), String> {
        let logs = self.folder.join("logs");
        for folder in [&self.states(), &logs] {
            if folder.exists() {
                std::fs::remove_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
            }
        }
        std::fs::create_dir(&logs).map_err(|error| format!("{}: {error}", logs.display()))?;
        self.forget_summary()?;
        std::fs::copy(&plan.launch_file, self.launch_copy())
            .map_err(|error| format!("{}: {error}", plan.launch_file.display()))?;
        self.write(SETTINGS, settings(plan).to_string().as_bytes())
    }

    /// Makes sure that `plan` is that of the run that was begun here: another would not go on with its bytes.
    pub fn resume(&self, plan: &Plan) -> Result<(), String> {
        let path = self.folder.join(SETTINGS);
        let begun = std::fs::read(&path).map_err(|error| format!("no run to resume: {}: {error}", path.display()))?;
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
        let summary = self.output.join("summary.json");
        match std::fs::remove_file(&summary) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(format!("{}: {error}", summary.display()))
            }
            _ => Ok(()),
        }
    }

    /// What the stages read, so that an edit during the run does not show in it.
    fn launch_copy(&self) -> PathBuf {
        self.folder.join("launch.toml")
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
        };
        let text = serde_json::to_vec_pretty(&assignment).map_err(|error| error.to_string())?;
        let name = format!("{}.json", stage.name);
        self.write(&name, &text)?;
        Ok(self.folder.join(name))
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), String> {
        let path = self.folder.join(name);
        std::fs::write(&path, bytes).map_err(|error| format!("{}: {error}", path.display()))
    }

    /// The last barrier of which every stage has its state on disk.
    pub fn last_complete_barrier(&self, stages: &[PlannedStage]) -> Option<u64> {
        let mut barriers = self.barriers();
        barriers.sort_unstable();
        let complete = |barrier: &u64| {
            let folder = self.states().join(barrier.to_string());
            stages.iter().all(|stage| folder.join(format!("{}.state", stage.name)).is_file())
        };
        barriers.into_iter().rev().find(complete)
    }

    /// Removes states that are not needed any more since `barrier` is complete.
    pub fn forget_before(&self, barrier: u64) {
        for old in self.barriers().into_iter().filter(|old| *old < barrier) {
            // What cannot be removed now is removed with the next barrier or the next run.
            let _ = std::fs::remove_dir_all(self.states().join(old.to_string()));
        }
    }

    fn barriers(&self) -> Vec<u64> {
        let entries = std::fs::read_dir(self.states()).into_iter().flatten().flatten();
        entries.filter_map(|entry| entry.file_name().to_string_lossy().parse().ok()).collect()
    }
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
