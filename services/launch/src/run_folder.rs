//! `<output>/run/`: the files that a run keeps about itself.
//!
//! | file | content |
//! |---|---|
//! | `domain` | the name of the run in shared memory |
//! | `lock` | held by the supervisor of the run and by all processes that it starts |
//! | `leases/<epoch>.json` | the lease of the supervisor, for other kernels ([`lease`]) |
//! | `launch.toml`, `settings.json` | the launch file, and the settings resolved from it |
//! | `wiring.json` | description of the run for observers ([`Wiring`]) |
//! | `<stage>.json` | the assignment of the stage |
//! | `logs/<stage>.log` | its log |
//! | `costs.csv` | work and cost of each stage over time, a line a second; not live ([`crate::costs`]) |
//! | `swaps.json` | the swaps of the run ([`SwapRecord`]) |
//! | `states/<barrier>/<stage>.state` | the stage's state at the barrier |
//!
//! After a kill at any moment, `--resume` continues from this folder: `settings.json` is the last file that a new run
//! writes and the first that the next one removes, and every file that is read again is complete or absent.

mod domain;
mod lease;
mod lock;
mod states;
mod used;

pub use lock::Patience;
pub use used::EarlierResults;

use crate::identity::{Files, UnreadableFile};
use crate::plan::{Plan, PlannedStage};
use crate::swap_record::SwapRecord;
use files::atomic_file::write_atomic;
use files::regular_file;
use ipc::{Domain, IpcError};
use lease::{Candidate, HeldLease};
use run::assignment::{Assignment, Restart};
use run::process::boottime_nanos;
use run::summary::{REPORT_FILES, Summary};
use run::wiring::Wiring;
use serde::{Deserialize, Serialize};
use states::States;
use std::cell::{Cell, OnceCell};
use std::fs::{File, Permissions};
use std::io::{Error, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// The resolved settings of the run.
const SETTINGS: &str = "settings.json";
/// Copy of the launch file.
const LAUNCH_FILE: &str = "launch.toml";
/// The name of the run in shared memory.
const DOMAIN: &str = "domain";
/// The swaps of the run.
const SWAPS: &str = "swaps.json";

/// An error that prevents use of the run folder.
#[derive(Debug, thiserror::Error)]
pub enum RunFolderError {
    /// A file or folder cannot be written.
    #[error("{file}: cannot be written: {source}; check [run] output")]
    Write {
        /// The file or folder.
        file: PathBuf,
        /// The operating system's error.
        source: Error,
    },
    /// A file cannot be read.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// The file.
        file: PathBuf,
        /// The operating system's error.
        source: Error,
    },
    /// A file of the run does not have its format.
    #[error("{file}: invalid content: {source}")]
    Content {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        source: serde_json::Error,
    },
    /// The lock cannot be taken, for another reason than another run.
    #[error("{file}: cannot be locked: {source}")]
    Lock {
        /// The lock.
        file: PathBuf,
        /// The operating system's error.
        source: Error,
    },
    /// Another run holds the lock.
    #[error(
        "{output}: another run is writing here; set another run.output, or end it with `replica stop --run {}`",
        files::shell::path(output)
    )]
    InUse {
        /// Folder of the results.
        output: PathBuf,
    },
    /// A run on another host holds the lease.
    #[error(
        "{output}: a run on host {host} (process {pid}) is writing here; wait for its end with --wait SECONDS, or end it there"
    )]
    InUseElsewhere {
        /// Folder of the results.
        output: PathBuf,
        /// Its host.
        host: String,
        /// Its supervisor.
        pid: u32,
    },
    /// The operator ended the wait for another run.
    #[error("{output}: the wait for another run that writes here was ended")]
    WaitEnded {
        /// Folder of the results.
        output: PathBuf,
    },
    /// Another run has taken the output over while this one stood still.
    #[error("{file}: another run has taken over this output; this one ends and writes nothing further")]
    LeaseLost {
        /// File of the other run's lease, or the removed file of the own one.
        file: PathBuf,
    },
    /// The lease has not been renewed in time.
    #[error("{output}: the lease cannot be renewed, so another run may write here; continue with --resume")]
    LeaseExpired {
        /// Folder of the results.
        output: PathBuf,
    },
    /// A new run would replace the results of an earlier one.
    #[error("{output}: holds the results of {results}")]
    Used {
        /// Folder of the results.
        output: PathBuf,
        /// Description of the results.
        results: EarlierResults,
    },
    /// `--resume` was given with settings that differ from the run's.
    #[error(
        "{output}: the run here was started with other settings or programs; resume it with the original ones, or replace \
         its results with --overwrite"
    )]
    OtherSettings {
        /// Folder of the results.
        output: PathBuf,
    },
    /// The content of a program, model or other file of the run has changed, so the run cannot continue.
    #[error(
        "{file}: its content has changed since the run into {output} started; restore it, or replace the results \
         with --overwrite"
    )]
    ChangedFile {
        /// The file.
        file: PathBuf,
        /// Folder of the results.
        output: PathBuf,
    },
    /// A program, model or other file of the run cannot be read.
    #[error(transparent)]
    Unreadable(#[from] UnreadableFile),
    /// The run has no name in shared memory.
    #[error(transparent)]
    Domain(#[from] IpcError),
}

impl RunFolderError {
    /// Whether the operator must change the command line or settings: a restart cannot help.
    pub fn is_of_configuration(&self) -> bool {
        matches!(self, Self::Used { .. } | Self::OtherSettings { .. } | Self::ChangedFile { .. })
    }
}

/// The lease of the output: waited for when the folder is locked, taken when the run begins to write.
struct Lease {
    candidate: Cell<Option<Candidate>>,
    held: OnceCell<HeldLease>,
}

/// The folder, locked for this supervisor.
pub struct RunFolder {
    folder: PathBuf,
    output: PathBuf,
    states: States,
    /// Released before the lock, so that the next run on this host finds it released.
    lease: Lease,
    _lock: File,
}

impl RunFolder {
    /// Creates and locks the folder under `output`. Every process that this one starts inherits the lock: it is free
    /// only after the last process of a run has ended, so that none of them writes into the next run. The lease does the
    /// same for other kernels.
    pub fn lock(output: &Path, patience: &mut Patience<'_>) -> Result<Self, RunFolderError> {
        let folder = output.join("run");
        create_run_folder(&folder)?;
        // From here on one folder has one name, regardless of links.
        let output = canonical(output)?;
        let lock = lock::take(&folder.join("lock"), &output, patience)?;
        let candidate = lock::wait_for_lease(&folder.join("leases"), &output, patience)?;
        let lease = Lease { candidate: Cell::new(Some(candidate)), held: OnceCell::new() };
        Ok(Self { states: States::new(folder.join("states")), folder, output, lease, _lock: lock })
    }

    /// The end of the time in which stages may begin a step, see [`Command::valid_until_nanos`].
    ///
    /// [`Command::valid_until_nanos`]: run::assignment::Command::valid_until_nanos
    pub fn valid_until_nanos(&self) -> u64 {
        self.lease.held.get().map_or(0, HeldLease::valid_until_nanos)
    }

    /// Takes the lease: from here on the run writes.
    fn take_lease(&self) -> Result<(), RunFolderError> {
        if let Some(candidate) = self.lease.candidate.take() {
            let held = lock::take_lease(candidate, &self.folder.join("leases"), &self.output)?;
            let _is_first = self.lease.held.set(held);
        }
        Ok(())
    }

    /// Reports that another run has taken the output over. A lease that is only late is not an error yet: stages wait for it.
    pub fn refuse_lost_lease(&self) -> Result<(), RunFolderError> {
        let lost = self.lease.held.get().and_then(HeldLease::take_lost);
        lost.map_or(Ok(()), |lost| Err(RunFolderError::LeaseLost { file: lost.file }))
    }

    /// Reports that this run may not write its results now.
    pub fn refuse_invalid_lease(&self) -> Result<(), RunFolderError> {
        self.refuse_lost_lease()?;
        if boottime_nanos() < self.valid_until_nanos() {
            return Ok(());
        }
        Err(RunFolderError::LeaseExpired { output: self.output.clone() })
    }

    /// The name of the run in shared memory.
    pub fn domain(&self) -> Result<Domain, RunFolderError> {
        domain::take(&self.folder.join(DOMAIN), &self.output)
    }

    /// The saved states.
    pub fn states(&self) -> &States {
        &self.states
    }

    /// Refuses a new run that would replace the results of an earlier one.
    pub fn refuse_earlier_results(&self) -> Result<(), RunFolderError> {
        match EarlierResults::find(&self.output) {
            Some(results) => Err(RunFolderError::Used { output: self.output.clone(), results }),
            None => Ok(()),
        }
    }

    /// Starts a new run: removes states and logs of an earlier one.
    pub fn begin(&self, plan: &Plan, files: &Files) -> Result<(), RunFolderError> {
        self.take_lease()?;
        remove_file(&self.folder.join(SETTINGS))?;
        let logs = self.folder.join("logs");
        for folder in [self.states.folder(), &logs] {
            if folder.exists() {
                std::fs::remove_dir_all(folder).map_err(|source| cannot_write(folder, source))?;
            }
        }
        std::fs::create_dir(&logs).map_err(|source| cannot_write(&logs, source))?;
        self.remove_summary()?;
        remove_file(&self.costs())?;
        self.write_swaps(&SwapRecord::default())?;
        self.write(LAUNCH_FILE, &read(&plan.launch_file)?)?;
        self.write_json(SETTINGS, &Begun { settings: settings(plan), files: files.clone() })
    }

    /// Whether a run was started here; if not, there is nothing to resume.
    pub fn has_begun(&self) -> bool {
        self.folder.join(SETTINGS).exists()
    }

    /// Checks that `plan` is the plan of the run that was started here: another plan would give different results.
    pub fn refuse_other_plan(&self, plan: &Plan, files: &Files) -> Result<(), RunFolderError> {
        let begun: Begun = self.read_json(SETTINGS)?;
        let same_file = regular_file::read(&plan.launch_file).ok() == regular_file::read(self.launch_copy()).ok();
        if !same_file || begun.settings != settings(plan) {
            return Err(RunFolderError::OtherSettings { output: self.output.clone() });
        }
        self.refuse_changed_files(files, &begun.files, None)
    }

    /// Continues the run that was started here after [`RunFolder::refuse_other_plan`]. Its results are no longer final.
    pub fn resume(&self, plan: &Plan, files: &Files) -> Result<(), RunFolderError> {
        self.refuse_other_plan(plan, files)?;
        self.take_lease()?;
        self.remove_summary()
    }

    /// Checks that all files are unchanged since `before`; files of the stage `except` may have changed.
    pub fn refuse_changed_files(
        &self,
        files: &Files,
        before: &Files,
        except: Option<&str>,
    ) -> Result<(), RunFolderError> {
        match files.changed_since(before, except) {
            Some(file) => Err(RunFolderError::ChangedFile { file: file.to_owned(), output: self.output.clone() }),
            None => Ok(()),
        }
    }

    /// Removes summary and report, which only a finished run has. Both are removed from the disk before the clouds
    /// change: after a power loss they would otherwise describe half-replaced clouds as done.
    fn remove_summary(&self) -> Result<(), RunFolderError> {
        let report = REPORT_FILES.map(|name| self.output.join(name));
        let of_finished_run = || report.iter().cloned().chain([Summary::file(&self.output)]);
        if !of_finished_run().any(|file| file.exists()) {
            return Ok(());
        }
        of_finished_run().try_for_each(|file| remove_file(&file))?;
        File::open(&self.output)
            .and_then(|output| output.sync_all())
            .map_err(|source| cannot_write(&self.output, source))
    }

    /// The launch file that the stages read: edits of the original during the run have no effect.
    pub fn launch_copy(&self) -> PathBuf {
        self.folder.join(LAUNCH_FILE)
    }

    /// Path of the costs, see [`crate::costs`].
    pub fn costs(&self) -> PathBuf {
        self.folder.join("costs.csv")
    }

    /// The stage's log. Every attempt appends to it.
    pub fn log(&self, stage: &str) -> PathBuf {
        self.folder.join("logs").join(format!("{stage}.log"))
    }

    /// Writes the assignment of a stage. Returns the file.
    pub fn assign(
        &self,
        plan: &Plan,
        stage: &PlannedStage,
        domain: &Domain,
        resume: Option<u64>,
        restart: Option<Restart>,
    ) -> Result<PathBuf, RunFolderError> {
        let assignment = Assignment {
            stage: stage.name.clone(),
            domain: domain.name().to_owned(),
            supervisor: std::process::id(),
            context: stage.table.remap.context(&plan.context),
            launch_file: self.launch_copy(),
            changes: plan.changes.clone(),
            inputs: stage.inputs.clone(),
            outputs: stage.outputs.clone(),
            barrier_s: plan.settings.barrier_s(),
            states: self.states.folder().to_owned(),
            resume,
            restart,
            remote: stage.remote.clone(),
        };
        let name = format!("{}.json", stage.name);
        self.write_json(&name, &assignment)?;
        Ok(self.folder.join(name))
    }

    /// Writes the description of the run for observers. They may read at any moment, so the file is complete or absent.
    pub fn write_wiring(&self, wiring: &Wiring) -> Result<(), RunFolderError> {
        self.write_json("wiring.json", wiring)
    }

    /// Writes the swaps of the run. The file is on the disk when this returns: the stages' next steps depend on it.
    pub fn write_swaps(&self, record: &SwapRecord) -> Result<(), RunFolderError> {
        self.write_json(SWAPS, record)
    }

    /// The swaps that [`RunFolder::write_swaps`] wrote last.
    pub fn read_swaps(&self) -> Result<SwapRecord, RunFolderError> {
        self.read_json(SWAPS)
    }

    fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), RunFolderError> {
        let text = serde_json::to_vec_pretty(value)
            .map_err(|source| RunFolderError::Content { file: self.folder.join(name), source })?;
        self.write(name, &text)
    }

    fn read_json<T: serde::de::DeserializeOwned>(&self, name: &str) -> Result<T, RunFolderError> {
        let file = self.folder.join(name);
        serde_json::from_slice(&read(&file)?).map_err(|source| RunFolderError::Content { file, source })
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), RunFolderError> {
        let path = self.folder.join(name);
        write_atomic(&path, bytes).map_err(|source| cannot_write(&path, source))
    }
}

/// The path without links.
pub fn canonical(path: &Path) -> Result<PathBuf, RunFolderError> {
    path.canonicalize().map_err(|source| RunFolderError::Read { file: path.to_owned(), source })
}

fn read(file: &Path) -> Result<Vec<u8>, RunFolderError> {
    regular_file::read(file).map_err(|source| RunFolderError::Read { file: file.to_owned(), source })
}

fn remove_file(path: &Path) -> Result<(), RunFolderError> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(cannot_write(path, error)),
        _ => Ok(()),
    }
}

fn cannot_write(path: &Path, source: Error) -> RunFolderError {
    RunFolderError::Write { file: path.to_owned(), source }
}

/// Content of `settings.json`: the state of the settings and files at the start of the run.
#[derive(Serialize, Deserialize)]
struct Begun {
    #[serde(flatten)]
    settings: serde_json::Value,
    files: Files,
}

/// Launch file, command line and the resolved settings.
fn settings(plan: &Plan) -> serde_json::Value {
    serde_json::json!({
        "launch_file": plan.launch_file,
        "changes": plan.changes,
        "run": plan.settings,
        "context": plan.context,
        "stages": plan.stages.iter().map(|s| serde_json::json!({
            "name": s.name, "program": s.program, "settings": s.description.settings,
        })).collect::<Vec<_>>(),
    })
}

/// The name in shared memory of the last run into `output`, which the next one cleans up.
pub fn last_domain(output: &Path) -> Option<Domain> {
    domain::last(&output.join("run").join(DOMAIN))
}

/// Creates the folder of a run, which only this user can enter: names and settings of a run are private to its owner.
fn create_run_folder(folder: &Path) -> Result<(), RunFolderError> {
    let failed = |source| cannot_write(folder, source);
    if let Some(output) = folder.parent() {
        std::fs::create_dir_all(output).map_err(failed)?;
    }
    match std::fs::DirBuilder::new().mode(0o700).create(folder) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
        Err(error) => return Err(failed(error)),
        // Files synced in the folder would be lost if the folder itself were not on the disk.
        Ok(()) => return folder.parent().map_or(Ok(()), |output| File::open(output)?.sync_all()).map_err(failed),
    }
    // A link created by another user would redirect the files of the run.
    let metadata = std::fs::symlink_metadata(folder).map_err(failed)?;
    if !metadata.is_dir() {
        return Err(cannot_write(folder, ErrorKind::NotADirectory.into()));
    }
    if metadata.mode() & 0o077 != 0 {
        // On file systems without modes this has no effect or fails; the folder is usable as it is.
        let _ = std::fs::set_permissions(folder, Permissions::from_mode(0o700));
    }
    Ok(())
}
