//! `replica-lab nearest`: a model whose last layer is replaced by labeled examples.

use crate::train::TrainingData;
use crate::train::recipe::Recipe;
use crate::train::recipe_data::Range;
use crate::train::sweep_dataset::SweepDataset;
use anyhow::Context;
use command_line::say_error;
use files::atomic_file::write_atomic;
use segmentation::spherical::{LoadedModel, Settings, SphericalModel};
use std::path::PathBuf;
use std::process::ExitCode;
use training::draw_examples;

/// Examples per class and folded column: at most 9700 for the 19 classes of the shipped model. A sweep then takes about a second.
const PER_CLASS: usize = 128;

/// Write a model that compares pixels with labeled examples.
///
/// The examples replace the last layer of the network (thesis section 6.3.2). They are drawn from the first drives of the recipe, one for
/// each of its towns. A run uses the file like any model: `[infer] model`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab nearest models/street_simulated.safetensors --recipe models/street_simulated.toml \
                  --out nearest.safetensors")]
pub struct Args {
    /// Model file of a network on images
    model: PathBuf,
    /// Recipe of the model
    #[arg(long, value_name = "RECIPE")]
    recipe: PathBuf,
    /// Number of nearest examples that vote, 1 to 1000
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=1000))]
    k: u16,
    /// File to write; created or replaced
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let bytes = model_with_examples(args)?;
    write_atomic(&args.out, &bytes).with_context(|| args.out.display().to_string())?;
    Ok(ExitCode::SUCCESS)
}

fn model_with_examples(args: &Args) -> anyhow::Result<Vec<u8>> {
    let LoadedModel { model, weights } = SphericalModel::load(&args.model)?;
    let recipe = Recipe::load(&args.recipe)?;
    let settings = Settings { nearest: None, ..model.settings().clone() };
    let Settings { temperature, ground_intensities, notice, .. } = settings.clone();
    anyhow::ensure!(
        settings == Settings { temperature, ground_intensities, notice, ..recipe.settings()? },
        "{} is not the recipe of {}",
        args.recipe.display(),
        args.model.display()
    );
    let seeds = recipe.data.seeds;
    let seeds = seeds.with_context(|| format!("{}: has no seeds of simulated towns", args.recipe.display()))?;
    let first = seeds.first;
    let last = seeds.last.min(seeds.first + recipe.data.towns.len() as u64 - 1);
    let mut dataset = SweepDataset::new(&recipe, &std::env::temp_dir())?;
    dataset.add_towns(&recipe.data, Range { first, last }, &mut |_, _| ())?;
    let examples = draw_examples(&settings, &weights, &dataset, PER_CLASS)?;
    let n_examples: usize = examples.iter().map(|of_column| of_column.classes.len()).sum();
    say_error!("{n_examples} examples of drives {first} to {last}");
    Ok(settings.to_bytes_with_examples(&weights, usize::from(args.k), &examples)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn recipe_of_another_network_is_refused_before_simulation() {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
        let text = std::fs::read_to_string(models.join("street.toml")).expect("the shipped recipe");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let recipe = folder.path().join("other.toml");
        std::fs::write(&recipe, text.replace("columns = 2048", "columns = 1024")).expect("writes");
        let out = folder.path().join("nearest.safetensors");
        let args = Args { model: models.join("street.safetensors"), recipe, k: 5, out };
        let error = run(&args).expect_err("is refused").to_string();
        assert!(error.contains("other.toml is not the recipe of") && error.contains("street.safetensors"), "{error}");
        assert!(!args.out.exists());
    }
}
