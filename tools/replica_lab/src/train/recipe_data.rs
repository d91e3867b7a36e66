//! Table `data` of all recipes: towns, sensors, seeds, recordings.

use super::removed_classes::RemovedClasses;
use anyhow::Context;
use serde::{Deserialize, Serialize};
use simulation::Town;
use std::path::PathBuf;
use town_sweeps::{Mount, town_from_name};
use training::TrainSettings;

/// Table `data`: sweeps of simulated towns, of recordings, or of both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// Kinds of town, used in turn.
    #[serde(default)]
    pub towns: Vec<String>,
    /// Names of LiDARs and mountings of the simulated drives, used in turn with each kind of town, as in `replica-lab evaluate classes --sensor`;
    /// without names, each drive has a random LiDAR.
    #[serde(default)]
    pub sensors: Vec<String>,
    /// Seeds of the training drives; absent without towns.
    pub seeds: Option<Range>,
    /// Seeds of the validation drives. They must not overlap with `seeds`.
    pub validation_seeds: Option<Range>,
    /// Length of each simulated drive, s.
    #[serde(default = "seconds")]
    pub seconds: f64,
    /// Submaps of each simulated drive.
    #[serde(default = "submaps")]
    pub submaps: usize,
    /// Sweeps of each simulated submap.
    #[serde(default = "sweeps")]
    pub sweeps: usize,
    /// Revolutions from one simulated sweep to the next.
    #[serde(default = "stride")]
    pub stride: u64,
    /// Names of classes whose points are left out, by their true labels. The model must not have them.
    #[serde(default)]
    pub removed_classes: Vec<String>,
    /// Probability that a sweep is used without its intensities.
    pub without_intensity: f32,
    /// Recordings.
    #[serde(default)]
    pub recordings: Vec<RecordingSource>,
}

fn seconds() -> f64 {
    150.0
}

fn submaps() -> usize {
    7
}

fn sweeps() -> usize {
    2
}

fn stride() -> u64 {
    5
}

/// A table of `data.recordings`: a recording with labeled submaps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingSource {
    /// The recording, relative to the folder of the recipe: labeled clouds that `replica import` has written, or a run that
    /// `replica-launch --record` has recorded.
    pub file: PathBuf,
    /// For a recorded run, the drive whose labels are the truth, relative to the folder of the recipe.
    pub drive: Option<PathBuf>,
    /// For self-training: the classes of the recorded run, which a model has predicted, serve as truth where their score is at
    /// least this, 0 to 1.
    pub predicted_above: Option<f32>,
    /// Whether the recording is used to compare epochs instead of for training.
    #[serde(default)]
    pub validation: bool,
    /// Examples per epoch for each of its sweeps, above 0 and at most 1000. Below 1, each epoch uses a different part of them.
    #[serde(default = "weight")]
    pub weight: f64,
    /// One sweep in this many is used.
    #[serde(default = "every")]
    pub every: usize,
}

impl RecordingSource {
    /// All of a recording of labeled clouds, once.
    pub fn new(file: PathBuf) -> Self {
        Self { file, drive: None, predicted_above: None, validation: false, weight: weight(), every: every() }
    }
}

fn weight() -> f64 {
    1.0
}

fn every() -> usize {
    1
}

/// Whole numbers from `first` to `last`, both included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    pub first: u64,
    pub last: u64,
}

impl Range {
    pub fn iter(self) -> impl Iterator<Item = u64> {
        self.first..=self.last
    }
}

impl RecordingSource {
    /// Checks the source by itself and against the recordings before it.
    fn check(&self, before: &[Self]) -> anyhow::Result<()> {
        let weight = self.weight;
        anyhow::ensure!(weight > 0.0 && weight <= 1000.0, "weight = {weight}, must be above 0 and at most 1000");
        anyhow::ensure!(
            !self.validation || weight == 1.0,
            "weight = {weight}, must be 1 for validation: each sweep counts once"
        );
        anyhow::ensure!(self.every > 0, "every = 0, must be at least 1");
        if let Some(score) = self.predicted_above {
            anyhow::ensure!((0.0..=1.0).contains(&score), "predicted_above = {score}, must be 0 to 1");
            anyhow::ensure!(
                self.drive.is_none(),
                "predicted_above: the labels of `drive` are the truth; remove one of the two"
            );
            anyhow::ensure!(!self.validation, "predicted_above: predictions cannot serve as truth for validation");
        }
        let is_same = |other: &Self| other.file == self.file || (self.drive.is_some() && other.drive == self.drive);
        let crosses = before.iter().any(|other| is_same(other) && other.validation != self.validation);
        anyhow::ensure!(!crosses, "is used for training and validation: validation needs other drives");
        Ok(())
    }
}

/// Checks the tables of all recipes against the classes of the model.
pub fn check_data_and_training(data: &Data, train: &TrainSettings, classes: &[String]) -> anyhow::Result<()> {
    if let Some(problem) = train.problem() {
        anyhow::bail!("[train] {problem}");
    }
    RemovedClasses::from_names(&data.removed_classes, classes)?;
    data.check()
}

impl Data {
    fn check(&self) -> anyhow::Result<()> {
        let data = self;
        self.towns()?;
        self.mounts()?;
        for (name, range) in [("seeds", data.seeds), ("validation_seeds", data.validation_seeds)] {
            let Some(range) = range else { continue };
            anyhow::ensure!(!data.towns.is_empty(), "[data] {name} needs towns, and towns is empty");
            anyhow::ensure!(range.first <= range.last, "[data] {name}: first must not be above last");
        }
        if let (Some(seeds), Some(validation)) = (data.seeds, data.validation_seeds) {
            let are_disjoint = seeds.last < validation.first || validation.last < seeds.first;
            anyhow::ensure!(are_disjoint, "[data] seeds and validation_seeds overlap: validation needs other drives");
        }
        for (what, seeds, validation) in
            [("train on", data.seeds, false), ("compare epochs on", data.validation_seeds, true)]
        {
            let has_any = seeds.is_some() || data.recordings.iter().any(|source| source.validation == validation);
            anyhow::ensure!(
                has_any,
                "[data] has nothing to {what}: {} or a recording with validation = {validation}",
                if validation { "validation_seeds" } else { "seeds" }
            );
        }
        for (i, source) in data.recordings.iter().enumerate() {
            source
                .check(&data.recordings[..i])
                .with_context(|| format!("[[data.recordings]] {}", source.file.display()))?;
        }
        anyhow::ensure!(
            data.submaps > 0 && data.sweeps > 0 && data.stride > 0,
            "[data] submaps, sweeps and stride must be above 0"
        );
        anyhow::ensure!((0.0..=1.0).contains(&data.without_intensity), "[data] without_intensity must be 0 to 1");
        Ok(())
    }
    /// Kinds of town.
    pub fn towns(&self) -> anyhow::Result<Vec<Town>> {
        Ok(self.towns.iter().map(|name| town_from_name(name)).collect::<Result<_, _>>()?)
    }
    /// LiDARs of the simulated drives; at least one.
    pub fn mounts(&self) -> anyhow::Result<Vec<Mount>> {
        if self.sensors.is_empty() {
            return Ok(vec![Mount::Random]);
        }
        named_mounts(&self.sensors).context("[data] sensors")
    }
}

/// The mounts of these names.
pub fn named_mounts(names: &[String]) -> anyhow::Result<Vec<Mount>> {
    let mount = |name: &String| {
        let known = || Mount::NAMED.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
        Mount::from_name(name).with_context(|| format!("unknown sensor {name:?}, must be one of {}", known()))
    };
    names.iter().map(mount).collect()
}
