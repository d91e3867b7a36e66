//! What to train, as a TOML file.

use anyhow::Context;
use learning::network::NetworkSpec;
use learning::spherical::{N_FEATURES, Settings};
use learning::training::TrainSettings;
use serde::{Deserialize, Serialize};
use simulation::Town;
use std::path::{Path, PathBuf};

/// A whole recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The network and its images.
    pub model: Model,
    /// What it learns from.
    pub data: Data,
    /// How.
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
    /// Channels of a U-Net's last convolution of 3 x 3, if others than its finest level has.
    pub head: Option<usize>,
    /// Columns of a sweep's image.
    pub columns: usize,
    /// Columns that the network sees as one.
    pub fold: usize,
    /// Names of the classes to tell apart; points of others count nowhere.
    pub classes: Vec<String>,
    /// Side of the cells in which sweeps vote, m.
    pub vote_cell_m: f32,
    /// A model to start from, a path from the recipe's folder: layers of the same name and shape begin with its weights, the
    /// others with random ones.
    pub start: Option<PathBuf>,
    /// Variables whose names begin so are left as they are.
    #[serde(default)]
    pub frozen: Vec<String>,
}

/// Table `data`: sweeps of simulated towns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// Kinds of town, taken in turn.
    pub towns: Vec<String>,
    /// Seeds of the drives to learn from.
    pub seeds: Range,
    /// Seeds of the drives to validate with; others.
    pub validation_seeds: Range,
    /// Length of each drive, s.
    pub seconds: f64,
    /// Stretches of each drive.
    pub submaps: usize,
    /// Sweeps of each stretch.
    pub sweeps: usize,
    /// Revolutions from one of them to the next.
    pub stride: u64,
    /// Probability that a sweep is shown without its intensities.
    pub without_intensity: f32,
}

/// Whole numbers from `first` to `last`.
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
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let recipe: Self = toml::from_str(&text).with_context(|| path.display().to_string())?;
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
        let apart = data.seeds.last < data.validation_seeds.first || data.validation_seeds.last < data.seeds.first;
        anyhow::ensure!(apart, "[data] seeds and validation_seeds overlap: nothing may be validated that was learned");
        anyhow::ensure!(
            data.submaps > 0 && data.sweeps > 0 && data.stride > 0,
            "[data] submaps, sweeps, stride: above 0"
        );
        anyhow::ensure!((0.0..=1.0).contains(&data.without_intensity), "[data] without_intensity must be 0 to 1");
        Ok(())
    }
    /// Kinds of town.
    pub fn towns(&self) -> anyhow::Result<Vec<Town>> {
        self.data.towns.iter().map(|name| town_from_name(name)).collect()
    }
    /// What the model file will say.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let model = &self.model;
        let (inputs, outputs) = (model.fold * N_FEATURES, model.fold * model.classes.len());
        let widths = model.widths.clone();
        let network = match model.kind.as_str() {
            "unet" => NetworkSpec::Unet { inputs, outputs, widths, head: model.head },
            "spherical_dz" if model.head.is_some() => anyhow::bail!("[model] head is of kind = \"unet\" alone"),
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

/// The kind of town of that name.
pub fn town_from_name(name: &str) -> anyhow::Result<Town> {
    let known = || Town::ALL.map(Town::name).join(", ");
    let town = Town::ALL.into_iter().find(|town| town.name() == name);
    town.with_context(|| format!("no kind of town is called {name:?}; there are {}", known()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped() -> String {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/street.toml");
        std::fs::read_to_string(path).expect("models/street.toml is part of the project")
    }

    /// What is said about the shipped recipe with a text in it replaced.
    fn refused(from: &str, to: &str) -> String {
        let text = shipped();
        assert!(text.contains(from), "no {from} in the recipe");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("recipe.toml");
        std::fs::write(&path, text.replace(from, to)).expect("writes");
        format!("{:#}", Recipe::load(&path).expect_err("is wrong"))
    }

    #[test]
    fn the_shipped_recipe_says_what_the_shipped_model_says() {
        let recipe: Recipe = toml::from_str(&shipped()).expect("is a recipe");
        recipe.check().expect("is right");
        let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/street.safetensors");
        let (model, _) = learning::spherical::SphericalModel::load(Path::new(model)).expect("loads");
        let temperature = model.settings().temperature;
        assert_eq!(model.settings(), &Settings { temperature, ..recipe.settings().expect("settings") });
    }

    #[test]
    fn wrong_recipes_are_refused_with_the_rule() {
        let said = |from: &str, to: &str, rule: &str| {
            let error = refused(from, to);
            assert!(error.contains("recipe.toml") && error.contains(rule), "{error}");
        };
        said("patience", "patients", "unknown field `patients`");
        said("\"vegetation\"", "\"trees\"", "are not all of the table");
        said("kind = \"unet\"", "kind = \"resnet\"", "must be \"unet\" or \"spherical_dz\"");
        said("fold = 4", "fold = 3", "must be a multiple of fold");
        said("last = 2008", "last = 3108", "seeds and validation_seeds overlap");
        said("kind = \"unet\"", "kind = \"spherical_dz\"", "head is of kind = \"unet\" alone");
        said("\"suburban\"", "\"atlantis\"", "no kind of town is called \"atlantis\"; there are urban");
        said("batch = 4", "batch = 0", "batch = 0, must be 1 to 1024");
    }
}
