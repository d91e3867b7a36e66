//! What is delivered: a finished run, or the drives of a survey.

use super::finished::open_finished_run;
use super::frame::unplaced;
use anyhow::ensure;
use std::path::Path;
use surveying::{RunFolder, SURVEY, open_survey};

/// At least one run, all in one frame.
pub struct Source {
    pub runs: Vec<RunFolder>,
    /// Names of the drives of a survey. Empty for a single run.
    pub drives: Vec<String>,
    /// Why the place on the Earth is not determined. Empty if it is.
    pub unplaced: Vec<String>,
}

impl Source {
    /// Opens a folder. There must be points.
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        let source = if folder.join(SURVEY).exists() {
            let (file, runs) = open_survey(folder)?;
            let drives = file.drives.into_iter().map(|drive| drive.name).collect();
            Self { runs, drives, unplaced: file.unplaced }
        } else {
            let (summary, run) = open_finished_run(folder, "deliver")?;
            Self { runs: vec![run], drives: Vec::new(), unplaced: unplaced(&summary) }
        };
        let n_clouds: usize = source.runs.iter().map(|run| run.index.clouds.len()).sum();
        ensure!(
            source.n_points() > 0,
            "{}: the run has {n_clouds} clouds with 0 points; `deliver` needs points\nhint: `replica inspect {}` shows which sensors of \
             the drive were used",
            folder.display(),
            files::shell::path(folder)
        );
        Ok(source)
    }

    /// Number of points of all clouds.
    pub fn n_points(&self) -> u64 {
        self.runs.iter().map(|run| run.index.n_points).sum()
    }
}
