//! `replica-lab train`: trains a model from a recipe.

mod augmentation;
mod bev_labels;
pub mod camera_columns;
mod camera_dropout;
mod ideal_columns;
mod images;
mod intensity_scale;
mod labeled_image;
mod point_dataset;
mod point_recipe;
mod points;
pub mod recipe;
pub mod recipe_data;
pub mod recorded_sweeps;
mod removed_classes;
mod sources;
mod submap_file;
mod submap_join;
pub mod sweep_dataset;
mod sweep_file;
#[cfg(test)]
mod test_recordings;
#[cfg(test)]
mod tests;

use anyhow::Context;
use command_line::argument::words;
use command_line::say_error;
use files::atomic_file::write_atomic;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use messages::ClassId;
use recipe::AnyRecipe;
use recipe_data::{Data, Range, RecordingSource};
use segmentation::ComputeDevice;
use segmentation::intensity::GroundIntensities;
use segmentation::network::Weights;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use training::{BestEpoch, Dataset, Hierarchy, Network, TrainSettings, Trainer};

/// Interface of the recipes of networks on images and on points, as the training uses it.
trait TrainingRecipe {
    type Network: Network;
    type Data: TrainingData + Dataset<<Self::Network as Network>::Example>;

    /// Settings that both kinds of recipe have.
    fn shared(&self) -> SharedRecipe<'_>;
    /// The network before the first step, trained on a device. Paths are relative to `folder`, the folder of the recipe.
    fn network(&self, folder: &Path, device: ComputeDevice) -> anyhow::Result<Self::Network>;
    /// A data set without examples, with a file in `folder`.
    fn empty_data(&self, folder: &Path, validation: bool) -> anyhow::Result<Self::Data>;
    /// The bytes of the model file.
    fn model(&self, weights: &Weights, calibration: Calibration) -> anyhow::Result<Vec<u8>>;
}

/// Tables and settings of all recipes.
struct SharedRecipe<'a> {
    data: &'a Data,
    train: &'a TrainSettings,
    /// Divisor of the logits; if `None`, it is fitted to the validation data.
    temperature: Option<f32>,
    /// Name prefixes of variables that are not trained.
    frozen: &'a [String],
    /// Share of the weights before training in the model file.
    start_share: f32,
    /// Names of the classes.
    classes: &'a [String],
}

/// Contents of a model file other than settings of the recipe and weights.
#[derive(Clone, Copy)]
struct Calibration {
    temperature: f32,
    ground_intensities: Option<GroundIntensities>,
}

/// Labeled examples of the sources of a recipe.
pub trait TrainingData {
    /// Simulates drives. Calls `progress` with the number of finished drives and of all drives.
    fn add_towns(&mut self, data: &Data, seeds: Range, progress: &mut dyn FnMut(usize, usize)) -> anyhow::Result<()>;
    /// Reads a recording; paths are relative to `folder`.
    fn add_recording(&mut self, source: &RecordingSource, folder: &Path) -> anyhow::Result<()>;
    /// Ends the sources.
    fn finish(&mut self) {}
    /// Description of the size.
    fn size(&self) -> String;
    /// Number of pixels or points of each class of the recipe.
    fn counts(&self) -> &[u64];
    /// Quantiles of the intensities of the ground.
    fn ground_intensities(&self) -> Option<GroundIntensities>;
}

/// Train a model that classifies points.
///
/// The stage infer loads the model. An interrupted training continues from its checkpoint when it is started again.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab train models/street.toml --out out/street")]
pub struct Args {
    /// Recipe (TOML)
    recipe: PathBuf,
    /// Folder for the model, the learning curves and the checkpoint; created if absent
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Stop after this number of epochs in total [default: as in the recipe]
    #[arg(long, value_name = "N")]
    stop_after: Option<usize>,
    /// Device that trains a network on images; cuda is the first NVIDIA GPU
    #[arg(long, value_name = "DEVICE", default_value_t = ComputeDevice::Cpu, value_parser = words::<ComputeDevice>())]
    device: ComputeDevice,
}

/// Name of the checkpoint file.
const CHECKPOINT: &str = "checkpoint.safetensors";

/// Runs the command. One line per epoch goes to stdout.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match AnyRecipe::load(&args.recipe)? {
        AnyRecipe::Images(recipe) => train(&recipe, args),
        AnyRecipe::Points(recipe) => train(&recipe, args),
    }
}

fn train<R: TrainingRecipe>(recipe: &R, args: &Args) -> anyhow::Result<ExitCode> {
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let mut trainer = trainer(recipe, &args.recipe, args.device)?;
    let start = trainer.best().clone();
    let uncalibrated = Calibration { temperature: 1.0, ground_intensities: None };
    let checkpoint = args.out.join(CHECKPOINT);
    if checkpoint.exists() {
        trainer.resume(&checkpoint)?;
        say_error!("resuming after epoch {} from {}", trainer.curves().epochs.len(), checkpoint.display());
    }
    let is_done = |trainer: &Trainer<R::Network>| {
        trainer.is_done() || args.stop_after.is_some_and(|n| trainer.curves().epochs.len() >= n)
    };
    let bar = progress_bar();
    let (data, validation) = if is_done(&trainer) {
        (None, None)
    } else {
        let data = dataset(recipe, args, recipe.shared().data.seeds, false, &bar)?;
        (Some(data), Some(dataset(recipe, args, recipe.shared().data.validation_seeds, true, &bar)?))
    };
    if let (Some(data), Some(validation)) = (&data, &validation) {
        print_class_counts(recipe, data)?;
        while !is_done(&trainer) {
            let number = trainer.curves().epochs.len();
            bar.set_message(format!("epoch {number}"));
            bar.reset();
            trainer.epoch(data, validation, &mut |done, all| set(&bar, done, all))?;
            write_state(recipe, &trainer, trainer.best(), uncalibrated, &args.out)?;
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
        let weights = trainer.best().mixed_with(&start, recipe.shared().start_share);
        let temperature = match recipe.shared().temperature {
            Some(temperature) => temperature,
            None => trainer.with_weights(&weights)?.temperature(validation)?,
        };
        let ground_intensities = data.as_ref().and_then(TrainingData::ground_intensities);
        let calibration = Calibration { temperature, ground_intensities };
        write_state(recipe, &trainer, &weights, calibration, &args.out)?;
    }
    if let Some(BestEpoch { epoch, mean_iou }) = trainer.curves().best() {
        writeln!(
            std::io::stdout(),
            "best: epoch {epoch}, mIoU {:.2} %: {}",
            100.0 * mean_iou,
            model_path(&args.out).display()
        )?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The data set for training or for validation, kept in a file in the folder of the model.
fn dataset<R: TrainingRecipe>(
    recipe: &R,
    args: &Args,
    seeds: Option<Range>,
    validation: bool,
    bar: &ProgressBar,
) -> anyhow::Result<R::Data> {
    let mut data = recipe.empty_data(&args.out, validation)?;
    if let Some(seeds) = seeds {
        bar.set_message("simulating sweeps");
        data.add_towns(recipe.shared().data, seeds, &mut |done, all| set(bar, done, all))?;
    }
    for source in recipe.shared().data.recordings.iter().filter(|source| source.validation == validation) {
        bar.set_message(format!("reading {}", source.file.display()));
        data.add_recording(source, folder_of(&args.recipe))?;
    }
    data.finish();
    Ok(data)
}

fn folder_of(recipe: &Path) -> &Path {
    recipe.parent().unwrap_or(Path::new(""))
}

fn trainer<R: TrainingRecipe>(recipe: &R, path: &Path, device: ComputeDevice) -> anyhow::Result<Trainer<R::Network>> {
    let network = recipe.network(folder_of(path), device)?;
    let classes: Vec<ClassId> = recipe.shared().classes.iter().filter_map(|name| ClassId::from_name(name)).collect();
    let tree = Hierarchy::from_classes(&classes);
    let mut trainer = Trainer::from_network(recipe.shared().train.clone(), network, classes.len(), tree)?;
    trainer.freeze(recipe.shared().frozen.to_vec());
    Ok(trainer)
}

fn print_class_counts<R: TrainingRecipe>(recipe: &R, data: &R::Data) -> anyhow::Result<()> {
    let counts = data.counts();
    let total = counts.iter().sum::<u64>().max(1);
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", data.size())?;
    for (name, n) in recipe.shared().classes.iter().zip(counts) {
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
fn write_state<R: TrainingRecipe>(
    recipe: &R,
    trainer: &Trainer<R::Network>,
    weights: &Weights,
    calibration: Calibration,
    out: &Path,
) -> anyhow::Result<()> {
    let write = |path: &Path, bytes: &[u8]| write_atomic(path, bytes).with_context(|| path.display().to_string());
    write(&model_path(out), &recipe.model(weights, calibration)?)?;
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
