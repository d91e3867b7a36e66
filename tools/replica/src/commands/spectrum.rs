//! `replica spectrum`: how reflectances are distributed, and whether they can be trusted (thesis 4.3.1; docs/spectrum.md).

mod channel;
mod clip;
mod diagnosis;
mod exposures;
mod figures;
mod input;
mod reference;
mod report;

use anyhow::Context;
use channel::Channel;
use clap::ValueEnum;
use clip::Clip;
use formats::envi::LibrarySpectrum;
use input::{Choice, Region, Source};
use report::{InputReport, Match, Report};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Statistics of reflectances by channel, with a diagnosis; several inputs are compared.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Drive folders (see --camera), ENVI cubes, or TIFFs of a sample for each band: of these the shares of the full scale.
    #[arg(required_unless_present = "exposures_ms", value_name = "DRIVE|CUBE.hdr|CUBE.tif")]
    inputs: Vec<PathBuf>,
    /// Mosaic camera of the drives, by name.
    #[arg(long)]
    camera: Option<String>,
    /// Simulate one street with these exposure times of the mosaic cameras, ms, and compare what they see, instead of inputs.
    #[arg(long, value_name = "MS,MS…", value_delimiter = ',', conflicts_with = "inputs", value_parser = positive)]
    exposures_ms: Vec<f64>,
    /// Seed of the simulated street.
    #[arg(long, default_value_t = 1, requires = "exposures_ms")]
    seed: u64,
    /// Only this frame of the camera, from 0; else all.
    #[arg(long)]
    frame: Option<usize>,
    /// Bands as the filters measured them, without the spectral correction of the camera's calibration file.
    #[arg(long)]
    uncorrected: bool,
    /// The camera maker's calibration file, for the wavelengths of TIFFs.
    #[arg(long, value_name = "XML")]
    sensor: Option<PathBuf>,
    /// The share of the white reference's signal, as if all frames had its exposure time: what a calibration without exposure
    /// times gives.
    #[arg(long)]
    ignore_exposure: bool,
    /// Reflectances above which the rate of pixels is told.
    #[arg(long, value_delimiter = ',', default_values_t = [0.05, 0.1, 0.15, 0.2, 0.25, 0.4, 0.6])]
    thresholds: Vec<f64>,
    /// Limit each channel to this reflectance, then stretch it to 0..1. The values are no reflectances any more.
    #[arg(long, value_name = "T", conflicts_with = "clip_percent", value_parser = positive)]
    clip_threshold: Option<f64>,
    /// Stretch the P % of each channel's values that are closest to its mean to 0..1. The values are no reflectances any more.
    #[arg(long, value_name = "P", value_parser = percent)]
    clip_percent: Option<f64>,
    /// Region of cells whose signature is told: left column, top row, columns, rows.
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    region: Option<Region>,
    /// Known spectra to compare the region's with: ENVI libraries (.sli) or ECOSTRESS texts (.txt).
    #[arg(long, value_name = "FILE", requires = "region")]
    reference: Vec<PathBuf>,
    /// Form of the tables.
    #[arg(long, value_enum, default_value_t = Format::Markdown)]
    format: Format,
    /// Folder for figures: histogram.svg, distribution.svg, of clipped values expanded.svg, of a region signature.svg, normalized.svg, and for
    /// each input a `pixels_N.svg` and a `region_N.png`.
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    Markdown,
    Csv,
    Json,
}

/// Known spectra that are told of a long library.
const N_MATCHES: usize = 5;

fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|value: &f64| *value > 0.0 && value.is_finite())
        .ok_or_else(|| "must be above 0".to_owned())
}

fn percent(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| *value > 0.0 && *value <= 100.0);
    value.ok_or_else(|| "must be above 0, up to 100".to_owned())
}

fn region(text: &str) -> Result<Region, String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| "must be four whole numbers X,Y,W,H".to_owned())
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let sensor = args.sensor.as_deref().map(super::read_sensor).transpose()?;
    let choice = Choice {
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
    let (mut sources, mut stretched, mut inputs) = (Vec::new(), Vec::new(), Vec::new());
    let clip = args.clip_threshold.map(Clip::UpTo).or(args.clip_percent.map(Clip::AroundMean));
    let folder = tempfile::tempdir().context("a folder for simulated drives")?;
    let simulated = exposures::simulate(folder.path(), &args.exposures_ms, args.seed, args.camera.as_deref())?;
    for path in args.inputs.iter().chain(&simulated) {
        let mut source = input::read(path, &choice)?;
        if simulated.contains(path) {
            source.name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        }
        // The diagnosis is of the data as they are.
        let diagnosis = diagnosis::diagnose(&source);
        let clipped: Vec<Channel> = match clip {
            Some(clip) => source.channels.iter().map(|channel| clip.stretched(channel, &[]).0).collect(),
            None => source.channels.clone(),
        };
        inputs.push(InputReport::new(&source, &clipped, diagnosis, &args.thresholds, matches(&source, &references)));
        sources.push(source);
        stretched.push(clipped);
    }
    let warning = clip.map(|clip| {
        format!("The values below were {} and stretched to 0..1: they are no reflectances, and must not be compared with any (the diagnosis and signatures are of the data before).", clip.words())
    });
    let report = Report { warning, thresholds: args.thresholds.clone(), inputs };
    let text = match args.format {
        Format::Markdown => report.markdown(),
        Format::Csv => report.csv(),
        Format::Json => serde_json::to_string_pretty(&report)? + "\n",
    };
    std::io::stdout().lock().write_all(text.as_bytes()).context("stdout")?;
    if let Some(folder) = &args.figures {
        let quantity = if args.ignore_exposure { "share of the white's signal" } else { "reflectance" };
        let figures =
            figures::Figures { sources: &sources, stretched: &stretched, clip, references: &references, quantity };
        figures.write(folder)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The nearest known spectra of the region's signature.
fn matches(source: &Source, references: &[LibrarySpectrum]) -> Vec<Match> {
    let wavelengths_nm: Vec<f32> = source.channels.iter().map(|channel| channel.wavelength_nm).collect();
    let means: Vec<f64> = (0..source.channels.len())
        .map(|channel| source.signature(channel).map_or(f64::NAN, |[mean, _]| mean))
        .collect();
    let mut matches: Vec<Match> = references
        .iter()
        .filter_map(|known| {
            let angle = reference::spectral_angle(&wavelengths_nm, &means, known)?;
            Some(Match { name: known.name.clone(), angle_deg: angle.to_degrees() })
        })
        .collect();
    matches.sort_by(|a, b| a.angle_deg.total_cmp(&b.angle_deg));
    matches.truncate(N_MATCHES);
    matches
}
