//! `replica train`: trains a model from a recipe.

mod augmentation;
mod labeled_image;
pub mod recipe;
mod recorded_sweeps;
pub mod sweep_dataset;
mod sweep_file;

use anyhow::Context;
use formats::atomic_file::write_atomic;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use messages::ClassId;
use recipe::{Range, Recipe};
use segmentation::engine::Border;
use segmentation::spherical::{Settings, SphericalModel};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use sweep_dataset::SweepDataset;
use training::Hierarchy;
use training::Trainer;
use training::Variables;

/// Train a model that gives points their classes.
///
/// The stage infer loads the model. Training that was interrupted continues from its checkpoint when it is started again.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage")]
pub struct Args {
    /// Recipe (TOML)
    recipe: PathBuf,
    /// Folder for the model, the learning curves and the checkpoint; created if absent
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Stop after this number of epochs in total [default: as in the recipe]
    #[arg(long, value_name = "N")]
    stop_after: Option<usize>,
}

/// Name of the checkpoint file.
const CHECKPOINT: &str = "checkpoint.safetensors";

/// Runs the command. One line per epoch goes to stdout.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let recipe = Recipe::load(&args.recipe)?;
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let settings = recipe.settings()?;
    let mut trainer = trainer(&recipe, &settings, &args.recipe)?;
    let checkpoint = args.out.join(CHECKPOINT);
    if checkpoint.exists() {
        trainer.resume(&checkpoint)?;
        eprintln!("resuming after epoch {} from {}", trainer.curves().epochs.len(), checkpoint.display());
    }
    let is_done =
        |trainer: &Trainer| trainer.is_done() || args.stop_after.is_some_and(|n| trainer.curves().epochs.len() >= n);
    let bar = progress_bar();
    let (data, validation) = if is_done(&trainer) {
        (None, None)
    } else {
        let data = dataset(&recipe, args, recipe.data.seeds, false, &bar)?;
        (Some(data), Some(dataset(&recipe, args, recipe.data.validation_seeds, true, &bar)?))
    };
    if let (Some(data), Some(validation)) = (&data, &validation) {
        print_class_counts(&settings, data)?;
        while !is_done(&trainer) {
            let number = trainer.curves().epochs.len();
            bar.set_message(format!("epoch {number}"));
            bar.reset();
            trainer.epoch(data, validation, &mut |done, all| set(&bar, done, all))?;
            write_state(&trainer, &settings, &args.out)?;
            let last = trainer.curves().epochs[number];
            bar.suspend(|| {
                writeln!(
                    std::io::stdout(),
                    "epoch {number}: loss {:.4}, validation loss {:.4}, mIoU {:.2} %, accuracy {:.2} %",
                    last.loss,
                    last.validation_loss,
                    100.0 * last.mean_iou,
                    100.0 * last.accuracy
                )
            })?;
        }
    }
    bar.finish_and_clear();
    if let Some(validation) = &validation {
        let temperature = trainer.best_trainer()?.temperature(validation)?;
        let ground_intensities = data.as_ref().and_then(SweepDataset::ground_intensities);
        let settings = Settings { temperature, ground_intensities, ..settings };
        write_state(&trainer, &settings, &args.out)?;
    }
    if let Some((epoch, mean_iou)) = trainer.curves().best() {
        writeln!(
            std::io::stdout(),
            "best: epoch {epoch}, mIoU {:.2} %: {}",
            100.0 * mean_iou,
            model_path(&args.out).display()
        )?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The sweeps that are trained on, or those for validation. They lie in a file in the folder of the model.
fn dataset(
    recipe: &Recipe,
    args: &Args,
    seeds: Option<Range>,
    validation: bool,
    bar: &ProgressBar,
) -> anyhow::Result<SweepDataset> {
    let mut data = SweepDataset::new(recipe, &args.out)?;
    if let Some(seeds) = seeds {
        bar.set_message("simulating sweeps");
        data.add_towns(recipe, seeds, &mut |done, all| set(bar, done, all))?;
    }
    let folder = args.recipe.parent().unwrap_or(Path::new(""));
    for source in recipe.data.recordings.iter().filter(|source| source.validation == validation) {
        bar.set_message(format!("reading {}", source.file.display()));
        data.add_recording(source, folder)?;
    }
    Ok(data)
}

fn trainer(recipe: &Recipe, settings: &Settings, path: &Path) -> anyhow::Result<Trainer> {
    let variables = match &recipe.model.start {
        Some(start) => {
            let start = path.parent().unwrap_or(Path::new("")).join(start);
            let (_, weights) = SphericalModel::load(&start)?;
            let variables = Variables::random(&settings.network, recipe.train.seed)?;
            let (n_taken, n_layers) = (variables.begin_with(&weights)?, settings.network.layers().len());
            anyhow::ensure!(
                n_taken > 0,
                "{}: no layer matches a layer of the recipe in name and shape",
                start.display()
            );
            eprintln!("starting from {n_taken} of {n_layers} layers of {}", start.display());
            variables
        }
        None => Variables::random(&settings.network, recipe.train.seed)?,
    };
    let classes: Vec<ClassId> = settings.check().map_err(anyhow::Error::msg)?;
    let tree = Hierarchy::of_classes(&classes);
    let shape = (classes.len(), settings.fold);
    let mut trainer = Trainer::new(recipe.train.clone(), variables, shape, Border::Circular, tree)?;
    trainer.freeze(recipe.model.frozen.clone());
    Ok(trainer)
}

fn print_class_counts(settings: &Settings, data: &SweepDataset) -> anyhow::Result<()> {
    let counts = data.counts();
    let total = counts.iter().sum::<u64>().max(1);
    let mut out = std::io::stdout().lock();
    writeln!(out, "{} sweeps, {total} labelled pixels", data.n_sweeps())?;
    for (name, n) in settings.classes.iter().zip(counts) {
        writeln!(out, "{name:>14} {:7.3} %", 100.0 * *n as f64 / total as f64)?;
    }
    if let Some(quantiles) = data.ground_intensities() {
        writeln!(out, "intensities of the ground at 5, 25, 50, 75, 95 %: {quantiles:?}")?;
    }
    Ok(())
}

fn model_path(out: &Path) -> PathBuf {
    out.join("model.safetensors")
}

/// Writes the model, the curves and, last, the checkpoint. Each file is complete or absent, also after a power loss.
fn write_state(trainer: &Trainer, settings: &Settings, out: &Path) -> anyhow::Result<()> {
    let write = |path: &Path, bytes: &[u8]| write_atomic(path, bytes).with_context(|| path.display().to_string());
    write(&model_path(out), &settings.to_bytes(trainer.best())?)?;
    write(&out.join("curves.csv"), trainer.curves().csv().as_bytes())?;
    write(&out.join("curves.svg"), trainer.curves().svg().as_bytes())?;
    write(&out.join(CHECKPOINT), &trainer.checkpoint()?)
}

fn set(bar: &ProgressBar, done: usize, all: usize) {
    bar.set_length(all as u64);
    bar.set_position(done as u64);
}

fn progress_bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr());
    // The template is a constant. If it were wrong, the bar would only look plain.
    match ProgressStyle::with_template("{msg} [{wide_bar}] {pos}/{len} {eta} left") {
        Ok(style) => bar.with_style(style.progress_chars("=> ")),
        Err(_) => bar,
    }
}
