//! The saved states of a run, by barrier.

use super::RunFolderError;
use crate::plan::PlannedStage;
use run::assignment::state_file;
use run::verify_state;
use std::path::{Path, PathBuf};

/// The states in `<output>/run/states`.
pub struct States {
    folder: PathBuf,
}

impl States {
    /// The states in `folder`.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder }
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The last barrier at which every stage has a complete state. A barrier that is skipped is logged with its first
    /// damaged file.
    pub fn last_complete_barrier(&self, stages: &[PlannedStage]) -> Option<u64> {
        let mut barriers = self.barriers();
        barriers.sort_unstable();
        barriers.into_iter().rev().find(|barrier| {
            let damaged = stages.iter().find_map(|stage| {
                let path = state_file(&self.folder, *barrier, &stage.name);
                verify_state(&path).err().map(|error| (path, error))
            });
            if let Some((path, error)) = &damaged {
                tracing::warn!(barrier, "barrier {barrier} is skipped: {}: {error}", path.display());
            }
            damaged.is_none()
        })
    }

    /// The last barrier at which this stage has a complete state.
    pub fn last_barrier_of(&self, stage: &str) -> Option<u64> {
        let is_complete = |barrier: &u64| verify_state(&state_file(&self.folder, *barrier, stage)).is_ok();
        self.barriers().into_iter().filter(is_complete).max()
    }

    /// Bytes that the stage itself saved at the barrier; 0 if they cannot be counted.
    pub fn bytes(&self, barrier: u64, stage: &str) -> u64 {
        run::saved_bytes(&state_file(&self.folder, barrier, stage)).unwrap_or_default()
    }

    /// Removes the states of all barriers before this one.
    pub fn remove_before(&self, barrier: u64) {
        for old in self.barriers().into_iter().filter(|old| *old < barrier) {
            // Files that cannot be removed now are removed with the next barrier or the next run.
            let _ = std::fs::remove_dir_all(self.folder.join(old.to_string()));
        }
    }

    /// Removes the states after `barrier` (`None`: all). They belong to an attempt that did not reach its next complete
    /// barrier, or to a swap that was undone, and must not be mixed with later states of the same numbers.
    pub fn remove_after(&self, barrier: Option<u64>) -> Result<(), RunFolderError> {
        for late in self.barriers().into_iter().filter(|late| barrier.is_none_or(|barrier| *late > barrier)) {
            let folder = self.folder.join(late.to_string());
            std::fs::remove_dir_all(&folder).map_err(|source| super::cannot_write(&folder, source))?;
        }
        Ok(())
    }

    /// Barriers with at least one state.
    pub(super) fn barriers(&self) -> Vec<u64> {
        let entries = std::fs::read_dir(&self.folder).into_iter().flatten().flatten();
        entries.filter_map(|entry| entry.file_name().to_string_lossy().parse().ok()).collect()
    }
}
