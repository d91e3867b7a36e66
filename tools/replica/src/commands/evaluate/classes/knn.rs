//! A model whose last layer gives way to examples of its training drives.

use crate::commands::train::recipe::{Range, Recipe};
use crate::commands::train::sweeps::Sweeps;
use learning::spherical::{Neighbors, Settings, SphericalModel};
use std::path::Path;

/// Examples of a class and folded column: 9700 at most of the 19 classes of the shipped model, with which a sweep takes about a
/// second.
const PER_CLASS: usize = 128;

/// Reads a model and draws its examples from the first drives of a recipe, one of each kind in its list of towns.
pub fn load(path: &Path, recipe: &Path, k: usize) -> anyhow::Result<SphericalModel> {
    let (model, weights) = SphericalModel::load(path)?;
    let of_recipe = Recipe::load(recipe)?;
    let settings = model.settings().clone();
    let temperature = settings.temperature;
    anyhow::ensure!(
        settings == Settings { temperature, ..of_recipe.settings()? },
        "{} is not the recipe of {}",
        recipe.display(),
        path.display()
    );
    let first = of_recipe.data.seeds.first;
    let last = of_recipe.data.seeds.last.min(first + of_recipe.data.towns.len() as u64 - 1);
    let sweeps = Sweeps::cast(&of_recipe, Range { first, last }, &|_, _| ())?;
    let neighbors = Neighbors::draw(&settings, &weights, &sweeps, PER_CLASS, k)?;
    eprintln!("{} examples of drives {first} to {last}", neighbors.len());
    Ok(model.with_neighbors(neighbors, &weights)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recipe_of_another_network_is_refused_before_anything_is_cast() {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
        let recipe = std::fs::read_to_string(models.join("street.toml")).expect("is part of the project");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let other = folder.path().join("other.toml");
        std::fs::write(&other, recipe.replace("columns = 2048", "columns = 1024")).expect("writes");
        let error = load(&models.join("street.safetensors"), &other, 5).err().expect("is refused").to_string();
        assert!(error.contains("other.toml is not the recipe of") && error.contains("street.safetensors"), "{error}");
    }
}
