//! A model with a k-nearest-neighbor classifier in place of its last layer.

use crate::train::TrainingData;
use crate::train::recipe::Recipe;
use crate::train::recipe_data::Range;
use crate::train::sweep_dataset::SweepDataset;
use anyhow::Context;
use command_line::say_error;
use segmentation::spherical::{LoadedModel, Settings, SphericalModel};
use std::path::Path;
use training::NearestExamples;

/// Examples per class and folded column: at most 9700 for the 19 classes of the shipped model. A sweep then takes about a second.
const PER_CLASS: usize = 128;

/// Reads a model and draws examples from the first drives of its recipe, one for each of the recipe's towns.
pub fn load(path: &Path, recipe: &Path, k: usize) -> anyhow::Result<SphericalModel> {
    let LoadedModel { model, weights } = SphericalModel::load(path)?;
    let of_recipe = Recipe::load(recipe)?;
    let settings = model.settings().clone();
    let Settings { temperature, ground_intensities, .. } = settings;
    anyhow::ensure!(
        settings == Settings { temperature, ground_intensities, ..of_recipe.settings()? },
        "{} is not the recipe of {}",
        recipe.display(),
        path.display()
    );
    let seeds = of_recipe.data.seeds;
    let seeds = seeds.with_context(|| format!("{}: has no seeds of simulated towns", recipe.display()))?;
    let first = seeds.first;
    let last = seeds.last.min(seeds.first + of_recipe.data.towns.len() as u64 - 1);
    let mut dataset = SweepDataset::new(&of_recipe, &std::env::temp_dir())?;
    dataset.add_towns(&of_recipe.data, Range { first, last }, &mut |_, _| ())?;
    let examples = NearestExamples::draw(&settings, &weights, &dataset, PER_CLASS, k)?;
    say_error!("{} examples of drives {first} to {last}", examples.len());
    Ok(model.with_classifier(Box::new(examples), &weights)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recipe_of_another_network_is_refused_before_simulation() {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
        let recipe = std::fs::read_to_string(models.join("street.toml")).expect("the shipped recipe");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let other = folder.path().join("other.toml");
        std::fs::write(&other, recipe.replace("columns = 2048", "columns = 1024")).expect("writes");
        let error = load(&models.join("street.safetensors"), &other, 5).err().expect("is refused").to_string();
        assert!(error.contains("other.toml is not the recipe of") && error.contains("street.safetensors"), "{error}");
    }
}
