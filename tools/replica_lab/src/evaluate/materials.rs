//! `replica-lab evaluate materials`: scores materials on simulated towns, and their gain for the classes.

mod fused_classes;
mod report;
mod tally;

use crate::materials::TownArgs;
use anyhow::Context;
use command_line::answer::Answer;
use files::regular_file;
use fused_classes::FusedClasses;
use materials::{Classifier, Method, Model, Places, Smoothing, materials_of};
use report::Report;
use segmentation::Options;
use std::path::PathBuf;
use std::process::ExitCode;
use tally::Tally;

/// Score the materials of points on simulated towns.
///
/// Scores points in view of the mosaic cameras. Prints all methods with and without smoothing; precision, recall and IoU of each
/// material, in sun and shade; accuracy by distance; the vegetation index; and with --model the classes of a network alone and corrected
/// by the spectra. Use seeds that were not used for `replica-lab fit-materials`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab evaluate materials --seeds 901,902")]
pub struct Args {
    #[command(flatten)]
    towns: TownArgs,
    /// Model of the materials [default: the built-in model]
    #[arg(long, value_name = "JSON")]
    materials: Option<PathBuf>,
    /// Network whose classes are corrected
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    #[command(flatten)]
    answer: Answer,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let model = match &args.materials {
        Some(path) => {
            let about = || path.display().to_string();
            Model::from_json(&regular_file::read_to_string(path).with_context(about)?).with_context(about)?
        }
        None => Model::built_in()?,
    };
    let segmenter = args.model.as_ref().map(|path| segmentation::load(path, &Options::default())).transpose()?;
    let mut tallies: Vec<(Method, Smoothing, Tally)> = Method::ALL
        .into_iter()
        .flat_map(|method| Smoothing::ALL.map(|smoothing| (method, smoothing, Tally::new())))
        .collect();
    let mut classes = FusedClasses::new();
    args.towns.for_each(true, |town| {
        let positions = town.positions();
        for (method, smoothing, tally) in &mut tallies {
            let classifier = Classifier::new(&model, &town.spectra.wavelengths_nm, *method);
            let places = Places { positions: &positions, regions: Some(&town.regions) };
            let found = materials_of(&classifier, &town.spectra, places, *smoothing);
            tally.add(town, &found);
            if (*method, *smoothing) == Default::default() {
                classes.add(town, &positions, &found, segmenter.as_deref())?;
            }
        }
        Ok(())
    })?;
    let report = Report { about: &model.about, tallies: &tallies, classes: &classes };
    args.answer.print(&report.json(), || report.markdown())?;
    Ok(ExitCode::SUCCESS)
}
