//! Recipes of trainings: TOML files.

use super::camera_columns::CameraNeeds;
use super::camera_dropout::ImageAugmentation;
use super::point_recipe::{KINDS, PointRecipe};
use super::recipe_data::{Data, check_data_and_training};
use anyhow::Context;
use files::text_file::read_toml;
use segmentation::network::NetworkSpec;
use segmentation::spherical::{Features, GroundUse, Settings};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use town_sweeps::BANDS_NM;
use training::TrainSettings;

/// A recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The network and its images.
    pub model: Model,
    /// The data of training and validation.
    pub data: Data,
    /// Random changes of the training images.
    #[serde(default)]
    pub augmentation: ImageAugmentation,
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
    /// Channels of the last 3 x 3 convolution of a U-Net, if they differ from its finest level.
    pub head: Option<usize>,
    /// Columns of a sweep's image.
    pub columns: usize,
    /// Columns that are folded into one column of the network.
    pub fold: usize,
    /// Names of the classes to distinguish. Points of other classes are ignored.
    pub classes: Vec<String>,
    /// Side of the voting cells, m.
    pub vote_cell_m: f32,
    /// Input features; by default as the shipped model.
    #[serde(default)]
    pub features: Features,
    /// `kept`, or `removed`: ground points are not in the image, and get the class `ground`.
    #[serde(default)]
    pub ground: GroundUse,
    /// A model to start from, relative to the folder of the recipe. Layers of the same name and shape start with its weights, the
    /// others with random weights; of the last layer, the outputs of classes of the same name.
    pub start: Option<PathBuf>,
    /// Share of the weights of `start` in the model file, 0 to 1: a mean of the weights before and after training is often better than
    /// both, above all on other data (Wortsman et al. 2022, "Robust fine-tuning of zero-shot models").
    #[serde(default)]
    pub start_share: f32,
    /// Divisor of the logits before they become scores, 0.1 to 10; by default calibrated on the validation data.
    pub temperature: Option<f32>,
    /// What users of the model must know, such as a restriction by its training data. A run notes it.
    pub notice: Option<String>,
    /// Name prefixes of variables that are not trained.
    #[serde(default)]
    pub frozen: Vec<String>,
}

/// A recipe of a network on images or on points.
pub enum AnyRecipe {
    Images(Recipe),
    Points(PointRecipe),
}

/// The kind of the network: it determines the other keys.
#[derive(Deserialize)]
struct Kind {
    model: KindOfModel,
}

#[derive(Deserialize)]
struct KindOfModel {
    kind: String,
}

impl AnyRecipe {
    /// Reads and checks a recipe.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let kind = read_toml::<Kind>(path).map_or(String::new(), |kind| kind.model.kind);
        if !KINDS.contains(&kind.as_str()) {
            return Recipe::load(path).map(Self::Images);
        }
        let about = || format!("{}: a recipe of a network on points, kind = {kind:?}", path.display());
        let recipe: PointRecipe = read_toml(path).with_context(about)?;
        recipe.check().with_context(about)?;
        Ok(Self::Points(recipe))
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
        if let Some(problem) = self.augmentation.problem() {
            anyhow::bail!("[augmentation] {problem}");
        }
        let needs = CameraNeeds::for_images(&self.model.features);
        let beyond = needs.bands.iter().find(|(nm, _)| !BANDS_NM.contains(nm) && !self.data.towns.is_empty());
        if let Some((_, feature)) = beyond {
            let [first, last] = [BANDS_NM.start(), BANDS_NM.end()];
            anyhow::bail!("[model] features: {feature}: simulated towns have reflectances at {first} to {last} nm");
        }
        anyhow::ensure!((0.0..=1.0).contains(&self.model.start_share), "[model] start_share must be 0 to 1");
        let has_start = self.model.start.is_some() || self.model.start_share == 0.0;
        anyhow::ensure!(has_start, "[model] start_share needs start");
        anyhow::ensure!(
            self.train.bev_head == 0.0 || self.model.kind == "unet",
            "[train] bev_head requires kind = \"unet\""
        );
        check_data_and_training(&self.data, &self.train, &self.model.classes)
    }
    /// Settings of the model file.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let model = &self.model;
        let inputs = model.fold * model.features.len();
        let outputs = model.fold * model.classes.len();
        let widths = model.widths.clone();
        let network = match model.kind.as_str() {
            "unet" => NetworkSpec::Unet { inputs, outputs, widths, head: model.head },
            "spherical_dz" if model.head.is_some() => anyhow::bail!("[model] head requires kind = \"unet\""),
            "spherical_dz" => NetworkSpec::SphericalDz { inputs, outputs, widths },
            other => {
                anyhow::bail!("[model] kind = {other:?}, must be \"unet\" or \"spherical_dz\", or one of {KINDS:?}")
            }
        };
        Ok(Settings {
            network,
            columns: model.columns,
            fold: model.fold,
            classes: model.classes.clone(),
            vote_cell_m: model.vote_cell_m,
            temperature: model.temperature.unwrap_or(1.0),
            ground_intensities: None,
            nearest: None,
            notice: model.notice.clone(),
            features: model.features.clone(),
            ground: model.ground,
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
        let model = segmentation::spherical::SphericalModel::load(Path::new(model)).expect("loads").model;
        let &Settings { temperature, ground_intensities, .. } = model.settings();
        let of_recipe = recipe.settings().expect("settings");
        assert_eq!(model.settings(), &Settings { temperature, ground_intensities, ..of_recipe });
    }

    #[test]
    fn invalid_recipe_is_refused_with_the_rule() {
        let check = |from: &str, to: &str, rule: &str| {
            let error = error_after_replacing(from, to);
            assert!(error.contains("recipe.toml") && error.contains(rule), "{error}");
        };
        check("patience", "patients", "unknown field `patients`");
        check("\"vegetation\"", "\"trees\"", "classes: unknown class \"trees\"; known are");
        check("kind = \"unet\"", "kind = \"resnet\"", "must be \"unet\" or \"spherical_dz\"");
        check("fold = 4", "fold = 4\nfeatures = ['colour']", "unknown feature \"colour\"; known are valid, range");
        check("fold = 4", "fold = 4\nfeatures = ['band_399']", "band_399: simulated towns have reflectances at 400 to");
        check(
            "[train]",
            "[augmentation]\ncolor_dropout = 1.5\n[train]",
            "[augmentation] color_dropout = 1.5; must be 0 to 1",
        );
        check("[train]", "[augmentation]\nnoise_m = 0.1\n[train]", "unknown field `noise_m`");
        check(
            "towns = [",
            "removed_classes = ['roads']\ntowns = [",
            "removed_classes: unknown class \"roads\"; known are",
        );
        check("towns = [", "removed_classes = ['road']\ntowns = [", "removed_classes: road is in classes of [model]");
        check("fold = 4", "fold = 3", "must be a multiple of fold");
        check("temperature = 1.33", "temperature = 0.01", "temperature = 0.01, must be 0.1 to 10");
        check("start_share = 0.5", "start_share = 1.5", "start_share must be 0 to 1");
        check("start = \"../out/street_before.safetensors\"", "", "start_share needs start");
        check("last = 2008", "last = 4100", "seeds and validation_seeds overlap");
        check("kind = \"unet\"", "kind = \"spherical_dz\"", "head requires kind = \"unet\"");
        check("validation_seeds = { first = 2001, last = 2008 }", "", "has nothing to compare epochs on");
        check("\"suburban\"", "\"atlantis\"", "unknown kind of town \"atlantis\", must be one of urban");
        check("batch = 4", "batch = 0", "batch = 0, must be 1 to 1024");
        check("batch = 4", "batch = 4\nconsistency = -1", "consistency = -1, must be 0 to 100");
        check("batch = 4", "batch = 4\nbev_head = nan", "bev_head = NaN, must be 0 to 100");
        check(
            "towns = [",
            "sensors = ['rig', 'vlp64']\ntowns = [",
            "unknown sensor \"vlp64\", must be one of rig, kitti",
        );
    }
}
