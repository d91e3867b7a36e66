//! The files in the output folder of a run.

use crate::data::inspect::georeference;
use anyhow::Context;
use delivery::{GeoreferenceFile, INDEX, Index};
use files::regular_file;
use geometry::Trajectory;
use run::summary::Summary;
use run::{Change, Mode};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use surveying::load_trajectory;

/// A run that has ended. All files except the summary may be absent.
pub struct FinishedRun {
    /// Output folder.
    pub folder: PathBuf,
    pub summary: Summary,
    /// The clouds.
    pub index: Option<Index>,
    /// Frame of the results. `None` also with the frame `odom`.
    pub georeference: Option<GeoreferenceFile>,
    /// The trajectory. Empty without a file.
    pub trajectory: Trajectory,
    /// Settings at the start of the run.
    pub begun: Option<Begun>,
}

/// The fields of `run/settings.json` that are shown.
#[derive(Debug, Deserialize)]
pub struct Begun {
    pub launch_file: PathBuf,
    /// Changes of the command line. `None` for a run of an earlier version.
    pub changes: Option<Vec<Change>>,
    pub context: RunContext,
    /// Digests of programs and other files by stage.
    #[serde(default)]
    pub files: BTreeMap<String, BTreeMap<PathBuf, FileDigest>>,
}

/// Input and mode of the run.
#[derive(Debug, Deserialize)]
pub struct RunContext {
    pub drive: PathBuf,
    pub mode: Mode,
}

#[derive(Debug, Deserialize)]
pub struct FileDigest {
    pub digest: String,
}

impl FinishedRun {
    /// Reads the small files of the run.
    pub fn load(folder: &Path) -> anyhow::Result<Self> {
        let summary =
            Summary::load(folder).context("hint: `replica report` needs the output folder of a run that has ended")?;
        Ok(Self {
            folder: folder.to_owned(),
            summary,
            index: json(&folder.join(INDEX)),
            georeference: georeference::load(folder),
            trajectory: load_trajectory(folder).unwrap_or_default(),
            begun: json(&folder.join("run/settings.json")),
        })
    }

    /// Whether it was a live run.
    pub fn is_live(&self) -> bool {
        self.begun.as_ref().is_some_and(|begun| begun.context.mode == Mode::Live)
    }

    /// The drive folder that was processed, or that a live run has recorded.
    pub fn drive(&self) -> Option<PathBuf> {
        if self.is_live() {
            return Some(self.folder.join("recording")).filter(|folder| folder.is_dir());
        }
        self.begun.as_ref().map(|begun| begun.context.drive.clone())
    }

    /// Whether clouds and trajectory have the same frame.
    pub fn has_local_clouds(&self) -> bool {
        self.georeference.as_ref().is_none_or(|found| found.frame == found.trajectory_frame)
    }

    /// Whether the clouds are placed on the earth, so that y is north.
    pub fn has_north(&self) -> bool {
        self.georeference.as_ref().is_some_and(|found| found.origin.is_some())
    }

    /// Instances of all submaps; one that continues from submap to submap counts once.
    pub fn n_instances(&self) -> u64 {
        let counter = |name: &str| self.counter("instance", name);
        counter("instances").saturating_sub(counter("instances_of_earlier_submaps"))
    }

    /// A counter of a stage; 0 if the stage has not counted it.
    pub fn counter(&self, stage: &str, name: &str) -> u64 {
        let stage = self.summary.stages.iter().find(|found| found.name == stage);
        stage.and_then(|stage| stage.counters.get(name)).copied().unwrap_or_default()
    }
}

/// The parsed file. `None` if it is absent or its version differs.
fn json<T: DeserializeOwned>(path: &Path) -> Option<T> {
    serde_json::from_slice(&regular_file::read(path).ok()?).ok()
}

#[cfg(test)]
impl FinishedRun {
    /// A run of which only the summary exists.
    pub fn from_summary(summary: Summary) -> Self {
        let trajectory = Trajectory::default();
        Self { folder: "out".into(), summary, index: None, georeference: None, trajectory, begun: None }
    }
}
