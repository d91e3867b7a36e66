//! Recipes of networks on points. Tables `data` and `train` are as in all recipes.

use super::recipe_data::{Data, check_data_and_training};
use anyhow::ensure;
use segmentation::points::{PointFeature, PointNetworkSpec, PointSettings, SphereSettings, SquareSettings};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use training::{Augmentation, TrainSettings};

/// Kinds of networks on points.
pub const KINDS: [&str; 4] = ["kpconv", "pointnet", "pointnet2", "waffle_iron"];

/// Largest number of examples of an epoch and of a validation.
const MOST_SPHERES: usize = 1_000_000;

/// A recipe of a network on points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointRecipe {
    /// The network and its points.
    pub model: PointModel,
    /// The data of training and validation.
    pub data: Data,
    /// The spheres of an epoch.
    #[serde(default)]
    pub spheres: Spheres,
    /// Random changes of the training spheres.
    #[serde(default)]
    pub augmentation: Augmentation,
    /// The settings of the training.
    pub train: TrainSettings,
}

/// Table `model`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointModel {
    /// One of [`KINDS`].
    pub kind: String,
    /// Settings of the network without `kind`, `inputs` and `outputs`.
    pub network: toml::Table,
    /// Names of the classes to distinguish. Points of other classes are ignored.
    pub classes: Vec<String>,
    /// Features of a point.
    pub features: Vec<PointFeature>,
    /// Side of the cells that are one point of the network, m.
    pub cell_m: f32,
    /// Radius of the spheres, m.
    pub radius_m: f32,
    /// Overlap of neighboring spheres in prediction, m; by default a third of the radius.
    pub overlap_m: Option<f32>,
    /// Squares for prediction, instead of spheres.
    pub squares: Option<SquareSettings>,
    /// Divisor of the logits before they become scores, 0.1 to 10; by default calibrated on the validation data.
    pub temperature: Option<f32>,
    /// What users of the model must know, such as a restriction by its training data. A run notes it.
    pub notice: Option<String>,
    /// A model to start from, relative to the folder of the recipe. Tensors of the same name and shape start with its values, the
    /// others with random values; of the last layer, the outputs of classes of the same name.
    pub start: Option<PathBuf>,
    /// Name prefixes of variables that are not trained.
    #[serde(default)]
    pub frozen: Vec<String>,
}

/// Table `spheres`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Spheres {
    /// Training spheres of an epoch. Each class is equally often the class of the center.
    pub epoch: usize,
    /// Spheres on which epochs are compared, evenly chosen from all spheres that cover the validation submaps.
    pub validation: usize,
}

impl Default for Spheres {
    fn default() -> Self {
        Self { epoch: 100, validation: 100 }
    }
}

impl PointRecipe {
    pub fn check(&self) -> anyhow::Result<()> {
        self.settings()?.check().map_err(|problem| anyhow::anyhow!("[model] {problem}"))?;
        for (key, n) in [("epoch", self.spheres.epoch), ("validation", self.spheres.validation)] {
            ensure!((1..=MOST_SPHERES).contains(&n), "[spheres] {key} = {n}, must be 1 to {MOST_SPHERES}");
        }
        if let Some(problem) = self.augmentation.problem() {
            anyhow::bail!("[augmentation] {problem}");
        }
        ensure!(
            self.model.kind != "pointnet" || self.train.batch > 1,
            "[train] batch = 1, must be at least 2 for pointnet: it normalizes over the spheres of a batch"
        );
        for (key, weight) in [("consistency", self.train.consistency), ("bev_head", self.train.bev_head)] {
            ensure!(weight == 0.0, "[train] {key} = {weight}, must be 0 for a network on points");
        }
        check_data_and_training(&self.data, &self.train, &self.model.classes)
    }
    /// Settings of the model file.
    pub fn settings(&self) -> anyhow::Result<PointSettings> {
        let model = &self.model;
        let count = |n: usize| toml::Value::Integer(i64::try_from(n).unwrap_or(i64::MAX));
        let own = [
            ("kind", toml::Value::String(model.kind.clone())),
            ("inputs", count(PointFeature::channels(&model.features))),
            ("outputs", count(model.classes.len())),
        ];
        let mut network = model.network.clone();
        for (key, value) in own {
            ensure!(
                network.insert(key.to_owned(), value).is_none(),
                "[model] network.{key}: must not be set; kind, features and classes of [model] determine it"
            );
        }
        let network = PointNetworkSpec::deserialize(toml::Value::Table(network))
            .map_err(|error| anyhow::anyhow!("[model] network: {}", error.to_string().trim_end()))?;
        Ok(PointSettings {
            network,
            classes: model.classes.clone(),
            features: model.features.clone(),
            cell_m: model.cell_m,
            spheres: SphereSettings {
                radius_m: model.radius_m,
                overlap_m: model.overlap_m.unwrap_or(model.radius_m / 3.0),
            },
            squares: model.squares,
            temperature: model.temperature.unwrap_or(1.0),
            ground_intensities: None,
            notice: model.notice.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::recipe::AnyRecipe;
    use segmentation::points::{PointModel, PointSettings};
    use std::path::Path;

    fn shipped(name: &str) -> String {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name);
        std::fs::read_to_string(path).expect("the recipe is part of the project")
    }

    fn load(text: &str) -> anyhow::Result<AnyRecipe> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("recipe.toml");
        std::fs::write(&path, text).expect("writes");
        AnyRecipe::load(&path)
    }

    /// The error of a shipped recipe after a replacement.
    fn error_after_replacing(name: &str, from: &str, to: &str) -> String {
        let text = shipped(name);
        assert!(text.contains(from), "no {from} in the recipe");
        format!("{:#}", load(&text.replacen(from, to, 1)).err().expect("is wrong"))
    }

    #[test]
    fn shipped_recipe_is_one_of_a_network_on_points() {
        assert!(matches!(load(&shipped("points.toml")).expect("is right"), AnyRecipe::Points(_)));
        assert!(matches!(load(&shipped("street.toml")).expect("is right"), AnyRecipe::Images(_)));
    }

    #[test]
    fn shipped_models_have_the_settings_of_their_recipes() {
        for name in ["points", "points_simulated"] {
            let AnyRecipe::Points(recipe) = load(&shipped(&format!("{name}.toml"))).expect("is right") else {
                panic!("a recipe of points")
            };
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../models/{name}.safetensors"));
            let model = PointModel::load(&path).expect("loads");
            let of_recipe = recipe.settings().expect("settings");
            let ground_intensities = model.settings().ground_intensities;
            assert_eq!(model.settings(), &PointSettings { ground_intensities, ..of_recipe });
        }
    }

    #[test]
    fn recipe_with_keys_of_the_other_kind_is_refused_by_the_key() {
        let check = |name: &str, from: &str, to: &str, rule: &str| {
            let error = error_after_replacing(name, from, to);
            assert!(error.contains("recipe.toml") && error.contains(rule), "{error}");
        };
        check("points.toml", "cell_m = 0.25", "cell_m = 0.25\ncolumns = 2048", "unknown field `columns`");
        check("points.toml", "cell_m = 0.25", "cell_m = 0.25\nwidths = [3]", "unknown field `widths`");
        check("points.toml", "waffle_iron", "unet", "unknown field `elastic`");
        check("street.toml", "fold = 4", "fold = 4\nradius_m = 4.0", "unknown field `radius_m`");
        check("street.toml", "[train]", "[spheres]\n[train]", "unknown field `spheres`");
        check("street.toml", "kind = \"unet\"", "kind = \"kpconv\"", "unknown field `columns`");
    }

    #[test]
    fn invalid_recipe_of_points_is_refused_with_the_rule() {
        let check = |from: &str, to: &str, rule: &str| {
            let error = error_after_replacing("points.toml", from, to);
            assert!(error.contains("recipe.toml") && error.contains(rule), "{error}");
        };
        check("width = 48", "width = 48, inputs = 3", "network.inputs: must not be set");
        check("width = 48", "width = 0", "0 channels or centers");
        check("width = 48", "widths = 48", "unknown field `widths`");
        check("\"offset\"", "\"color\"", "unknown variant `color`");
        check("temperature = 1.0", "temperature = 0.01", "temperature = 0.01, must be 0.1 to 10");
        check("epoch = ", "epoch = 0 #", "[spheres] epoch = 0");
        check("noise_m = ", "noise_m = -1 #", "[augmentation] noise_m = -1");
        check("batch = ", "batch = 0 #", "[train] batch = 0");
        check("towns = [", "removed_classes = ['pole']\ntowns = [", "pole is in classes of [model]");
        check("last = 2008", "last = 4008", "seeds and validation_seeds overlap");
        check("radius_m = 12.0", "radius_m = 0.0", "[model] model settings: spheres: radius_m = 0");
    }
}
