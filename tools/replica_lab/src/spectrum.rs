//! `replica-lab spectrum`: statistics and diagnosis of reflectances (thesis section 4.3.1).

mod figures;
mod input;
mod lines;
mod materials;
pub mod reference;
mod report;
mod simulated_exposures;
mod stretch;

use crate::sensor_calibration;
use anyhow::Context;
use clap::ValueEnum;
use command_line::answer::Answer;
use command_line::argument::{percent, positive, rectangle};
use formats::envi::LibrarySpectrum;
use input::InputSelection;
use pictures::bands::channel::Channel;
use pictures::bands::diagnosis::diagnose;
use pictures::bands::source::Region;
use report::{InputReport, Report};
use std::path::PathBuf;
use std::process::ExitCode;
use stretch::Stretch;

/// Show statistics and a diagnosis of reflectances.
///
/// Lists statistics per channel, and compares several inputs.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab spectrum drives/sample --figures figures")]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Args {
    #[command(subcommand)]
    action: Option<Action>,
    /// Drive folders (see --camera), ENVI cubes, or TIFFs with one sample per band, whose values are shares of the full scale
    #[arg(required_unless_present = "exposures_ms", value_name = "DRIVE|CUBE.hdr|CUBE.tif")]
    inputs: Vec<PathBuf>,
    /// Name of the mosaic camera of the drives [default: the only one]
    #[arg(long)]
    camera: Option<String>,
    /// Instead of inputs: simulate one street with these exposure times of the mosaic cameras, ms, and compare the images
    #[arg(long, value_name = "MS,MS,...", value_delimiter = ',', conflicts_with = "inputs", value_parser = positive)]
    exposures_ms: Vec<f64>,
    /// Seed of the simulated street
    #[arg(long, default_value_t = 1, requires = "exposures_ms")]
    seed: u64,
    /// Number of the frame to use, from 0 [default: all frames]
    #[arg(long)]
    frame: Option<usize>,
    /// No spectral correction: bands as measured by the filters
    #[arg(long)]
    uncorrected: bool,
    /// Calibration file of the manufacturer, for the wavelengths of TIFFs
    #[arg(long, value_name = "XML")]
    sensor: Option<PathBuf>,
    /// Ignore exposure times: values become shares of the signal of the white reference
    #[arg(long)]
    ignore_exposure: bool,
    /// Reflectances above which the share of pixels is reported, 0 to 1
    #[arg(long, value_delimiter = ',', default_values_t = [0.05, 0.1, 0.15, 0.2, 0.25, 0.4, 0.6])]
    thresholds: Vec<f64>,
    /// Clip each channel at this reflectance, then stretch it to 0..1; the values are then no longer reflectances
    #[arg(long, value_name = "T", conflicts_with = "clip_percent", value_parser = positive)]
    clip_threshold: Option<f64>,
    /// Stretch the P % of each channel's values that are closest to its mean to 0..1; the values are then no longer reflectances
    #[arg(long, value_name = "P", value_parser = percent)]
    clip_percent: Option<f64>,
    /// Region whose signature is reported: left column, top row, columns, rows, in cells
    #[arg(long, value_name = "X,Y,W,H", value_parser = rectangle::<usize>)]
    region: Option<Region>,
    /// Reference spectra to compare the signature with: ENVI libraries (.sli) or ECOSTRESS files (.txt)
    #[arg(long, value_name = "FILE", requires = "region")]
    reference: Vec<PathBuf>,
    /// Format of the report
    #[arg(long, value_enum, default_value_t = Format::Markdown)]
    format: Format,
    /// Folder for figures: histogram.svg and distribution.svg; with clipping expanded.svg; with a region signature.svg,
    /// normalized.svg, and `pixels_N.svg` and `region_N.png` for each input
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    #[command(flatten)]
    answer: Answer,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    Lines(Box<lines::Args>),
    Materials(materials::Args),
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    Markdown,
    Csv,
    /// One JSON object, as with --json.
    Json,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.action {
        Some(Action::Lines(args)) => return lines::run(args),
        Some(Action::Materials(args)) => return materials::run(args),
        None => {}
    }
    let sensor = args.sensor.as_deref().map(sensor_calibration::read).transpose()?;
    let selection = InputSelection {
        sensor: sensor.as_ref(),
        camera: args.camera.as_deref(),
        frame: args.frame,
        correction: !args.uncorrected,
        ignore_exposure: args.ignore_exposure,
        region: args.region,
    };
    let references: Vec<Vec<LibrarySpectrum>> =
        args.reference.iter().map(|path| reference::read(path)).collect::<Result<_, _>>()?;
    let references = references.concat();
    let mut sources = Vec::new();
    let mut stretched = Vec::new();
    let mut inputs = Vec::new();
    let stretch = args.clip_threshold.map(Stretch::UpTo).or(args.clip_percent.map(Stretch::AroundMean));
    let folder = tempfile::tempdir().context("cannot create a temporary folder for simulated drives")?;
    let simulated =
        simulated_exposures::simulate(folder.path(), &args.exposures_ms, args.seed, args.camera.as_deref())?;
    for path in args.inputs.iter().chain(&simulated) {
        let mut source = input::read(path, &selection)?;
        if simulated.contains(path) {
            source.name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        }
        // The diagnosis is made from the data before clipping.
        let diagnosis = diagnose(&source);
        let after: Vec<Channel> = match stretch {
            Some(stretch) => source.channels.iter().map(|channel| stretch.apply(channel, &[]).channel).collect(),
            None => source.channels.clone(),
        };
        inputs.push(InputReport::new(
            &source,
            &after,
            diagnosis,
            &args.thresholds,
            reference::nearest(&source, &references),
        ));
        sources.push(source);
        stretched.push(after);
    }
    let warning = stretch.map(|stretch| {
        format!(
            "The values below were {} and stretched to 0..1. They are not reflectances. Diagnosis and signatures describe the \
             data before stretching.",
            stretch.description()
        )
    });
    let report = Report { warning, thresholds: args.thresholds.clone(), inputs };
    let answer = args.answer.or(matches!(args.format, Format::Json));
    answer.print(&report, || if matches!(args.format, Format::Csv) { report.csv() } else { report.markdown() })?;
    if let Some(folder) = &args.figures {
        let quantity = if args.ignore_exposure { "share of the white signal" } else { "reflectance" };
        let figures =
            figures::Figures { sources: &sources, stretched: &stretched, stretch, references: &references, quantity };
        figures.write(folder)?;
    }
    Ok(ExitCode::SUCCESS)
}
