//! Recipes of trainings: TOML files.

use anyhow::Context;
use formats::text_file::read_toml;
use segmentation::network::NetworkSpec;
use segmentation::spherical::{N_FEATURES, Settings};
use serde::{Deserialize, Serialize};
use simulation::Town;
use std::path::{Path, PathBuf};
use town_sweeps::town_from_name;
use training::TrainSettings;

/// A recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The network and its images.
    pub model: Model,
    /// The data of training and validation.
    pub data: Data,
    /// The settings of the training.
    pub train: TrainSettings,
}

/// Table `model`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// `unet` or `spherical_dz`.
    pub kind: String,
    /// Channels of each level.
    pub widths: Vec<usize>,
    /// Channels of the last 3 x 3 convolution of a U-Net, if they differ from those of its finest level.
    pub head: Option<usize>,
    /// Columns of a sweep's image.
    pub columns: usize,
    /// Columns that are folded into one column of the network.
    pub fold: usize,
    /// Names of the classes to distinguish. Points of other classes are ignored.
    pub classes: Vec<String>,
    /// Side of the voting cells, m.
    pub vote_cell_m: f32,
    /// A model to start from, relative to the folder of the recipe. Layers of the same name and shape start with its weights, the
    /// others with random weights.
    pub start: Option<PathBuf>,
    /// Name prefixes of variables that are not trained.
    #[serde(default)]
    pub frozen: Vec<String>,
}

/// Table `data`: sweeps of simulated towns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// Kinds of town, used in turn.
    pub towns: Vec<String>,
    /// Seeds of the training drives.
    pub seeds: Range,
    /// Seeds of the validation drives. They must not overlap with `seeds`.
    pub validation_seeds: Range,
    /// Length of each drive, s.
    pub seconds: f64,
    /// Submaps of each drive.
    pub submaps: usize,
    /// Sweeps of each submap.
    pub sweeps: usize,
    /// Revolutions from one sweep to the next.
    pub stride: u64,
    /// Probability that a sweep is used without its intensities.
    pub without_intensity: f32,
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

impl Recipe {
    /// Reads and checks a recipe.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let recipe: Self = read_toml(path).with_context(|| path.display().to_string())?;
        recipe.check().with_context(|| path.display().to_string())?;
        Ok(recipe)
    }
    fn check(&self) -> anyhow::Result<()> {
        self.settings()?.check().map_err(|problem| anyhow::anyhow!("[model] {problem}"))?;
        if let Some(problem) = self.train.problem() {
            anyhow::bail!("[train] {problem}");
        }
        let data = &self.data;
        self.towns()?;
        anyhow::ensure!(!data.towns.is_empty(), "[data] towns is empty");
        for (name, range) in [("seeds", data.seeds), ("validation_seeds", data.validation_seeds)] {
            anyhow::ensure!(range.first <= range.last, "[data] {name}: first must not be above last");
        }
        let are_disjoint =
            data.seeds.last < data.validation_seeds.first || data.validation_seeds.last < data.seeds.first;
        anyhow::ensure!(are_disjoint, "[data] seeds and validation_seeds overlap: validation needs other drives");
        anyhow::ensure!(
            data.submaps > 0 && data.sweeps > 0 && data.stride > 0,
            "[data] submaps, sweeps and stride must be above 0"
        );
        anyhow::ensure!((0.0..=1.0).contains(&data.without_intensity), "[data] without_intensity must be 0 to 1");
        Ok(())
    }
    /// Kinds of town.
    pub fn towns(&self) -> anyhow::Result<Vec<Town>> {
        Ok(self.data.towns.iter().map(|name| town_from_name(name)).collect::<Result<_, _>>()?)
    }
    /// Settings of the model file.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let model = &self.model;
        let (inputs, outputs) = (model.fold * N_FEATURES, model.fold * model.classes.len());
        let widths = model.widths.clone();
        let network = match model.kind.as_str() {
            "unet" => NetworkSpec::Unet { inputs, outputs, widths, head: model.head },
            "spherical_dz" if model.head.is_some() => anyhow::bail!("[model] head requires kind = \"unet\""),
            "spherical_dz" => NetworkSpec::SphericalDz { inputs, outputs, widths },
            other => anyhow::bail!("[model] kind = {other:?}, must be \"unet\" or \"spherical_dz\""),
        };
        Ok(Settings {
            network,
            columns: model.columns,
            fold: model.fold,
            classes: model.classes.clone(),
            vote_cell_m: model.vote_cell_m,
            temperature: 1.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped() -> String {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/street.toml");
        std::fs::read_to_string(path).expect("models/street.toml is part of the project")
    }

    /// The error of the shipped recipe after a replacement.
    fn error_after_replacing(from: &str, to: &str) -> String {
        let text = shipped();
        assert!(text.contains(from), "no {from} in the recipe");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("recipe.toml");
        std::fs::write(&path, text.replace(from, to)).expect("writes");
        format!("{:#}", Recipe::load(&path).expect_err("is wrong"))
    }

    #[test]
    fn shipped_recipe_matches_shipped_model() {
        let recipe: Recipe = toml::from_str(&shipped()).expect("is a recipe");
        recipe.check().expect("is right");
        let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/street.safetensors");
        let (model, _) = segmentation::spherical::SphericalModel::load(Path::new(model)).expect("loads");
        let temperature = model.settings().temperature;
        assert_eq!(model.settings(), &Settings { temperature, ..recipe.settings().expect("settings") });
    }

    #[test]
    fn invalid_recipe_is_refused_with_the_rule() {
        let check = |from: &str, to: &str, rule: &str| {
            let error = error_after_replacing(from, to);
            assert!(error.contains("recipe.toml") && error.contains(rule), "{error}");
        };
        check("patience", "patients", "unknown field `patients`");
        check("\"vegetation\"", "\"trees\"", "not all are in the class table");
        check("kind = \"unet\"", "kind = \"resnet\"", "must be \"unet\" or \"spherical_dz\"");
        check("fold = 4", "fold = 3", "must be a multiple of fold");
        check("last = 2008", "last = 3108", "seeds and validation_seeds overlap");
        check("kind = \"unet\"", "kind = \"spherical_dz\"", "head requires kind = \"unet\"");
        check("\"suburban\"", "\"atlantis\"", "unknown kind of town \"atlantis\", must be one of urban");
        check("batch = 4", "batch = 0", "batch = 0, must be 1 to 1024");
    }
}
