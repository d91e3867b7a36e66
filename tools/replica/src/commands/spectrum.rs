//! `replica spectrum`: how reflectances are distributed, and whether they can be trusted (thesis 4.3.1; docs/spectrum.md).

mod channel;
mod diagnosis;
mod exposures;
mod input;
mod reference;
mod report;

use anyhow::Context;
use chart::{Axis, Chart, Series};
use clap::ValueEnum;
use formats::envi::LibrarySpectrum;
use input::{Choice, Region, Source};
use report::{InputReport, Match, Report};
use std::io::Write;
use std::path::{Path, PathBuf};
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
    /// Folder for figures: histogram.svg, distribution.svg, of a region signature.svg, of clipped values expanded.svg.
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
/// Intervals of the figures' histograms.
const N_INTERVALS: usize = 100;

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
    let (mut sources, mut originals, mut inputs) = (Vec::new(), Vec::new(), Vec::new());
    let folder = tempfile::tempdir().context("a folder for simulated drives")?;
    let simulated = exposures::simulate(folder.path(), &args.exposures_ms, args.seed, args.camera.as_deref())?;
    for path in args.inputs.iter().chain(&simulated) {
        let mut source = input::read(path, &choice)?;
        if simulated.contains(path) {
            source.name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        }
        // The diagnosis is of the data as they are.
        let diagnosis = diagnosis::diagnose(&source);
        originals.push(source.channels.clone());
        clip(&mut source, args);
        inputs.push(InputReport::new(&source, diagnosis, &args.thresholds, matches(&source, &references)));
        sources.push(source);
    }
    let warning = clip_words(args).map(|how| {
        format!("The values below were {how} and stretched to 0..1: they are no reflectances, and must not be compared with any (the diagnosis and signatures are of the data before).")
    });
    let report = Report { warning, thresholds: args.thresholds.clone(), inputs };
    let text = match args.format {
        Format::Markdown => report.markdown(),
        Format::Csv => report.csv(),
        Format::Json => serde_json::to_string_pretty(&report)? + "\n",
    };
    std::io::stdout().lock().write_all(text.as_bytes()).context("stdout")?;
    if let Some(folder) = &args.figures {
        let quantity = match (clip_words(args), args.ignore_exposure) {
            (Some(_), _) => "stretched value (no reflectance)",
            (None, true) => "share of the white's signal",
            (None, false) => "reflectance",
        };
        draw(folder, &sources, &references, quantity)?;
        if let Some(how) = clip_words(args) {
            let both = sources.iter().zip(&originals).map(|(source, original)| (&original[..], &source.channels[..]));
            let title = format!("Histograms by channel before and after they were {how}");
            let path = folder.join("expanded.svg");
            std::fs::write(&path, expanded(&title, both).svg()).with_context(|| path.display().to_string())?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn clip(source: &mut Source, args: &Args) {
    for channel in &mut source.channels {
        if let Some(threshold) = args.clip_threshold {
            *channel = channel.clipped_at(threshold);
        } else if let Some(percent) = args.clip_percent {
            *channel = channel.clipped_around_mean(percent / 100.0);
        }
    }
}

fn clip_words(args: &Args) -> Option<String> {
    match (args.clip_threshold, args.clip_percent) {
        (Some(threshold), _) => Some(format!("clipped at {threshold}")),
        (None, Some(percent)) => Some(format!("clipped by channel to the {percent} % of pixels closest to the mean")),
        (None, None) => None,
    }
}

/// The nearest known spectra of the region's signature.
fn matches(source: &Source, references: &[LibrarySpectrum]) -> Vec<Match> {
    let wavelengths_nm: Vec<f32> = source.channels.iter().map(|channel| channel.wavelength_nm).collect();
    let means: Vec<f64> = source.signature.iter().map(input::Moments::mean).collect();
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

/// Figures 4.7 and 4.8 of the thesis: histograms before (first color) and after (second color), one line for each channel.
fn expanded<'a>(title: &str, inputs: impl Iterator<Item = (&'a [channel::Channel], &'a [channel::Channel])>) -> Chart {
    let middle = |i: usize| (i as f64 + 0.5) / N_INTERVALS as f64;
    let line = |group: usize, channel: &channel::Channel| {
        let shares = channel.histogram(N_INTERVALS);
        let points = shares.iter().enumerate().map(|(i, share)| [middle(i), share * 100.0]);
        Series::thin_line(["before", "after"][group], chart::COLORS[group], points.collect())
    };
    let lines: Vec<Series> = inputs
        .flat_map(|(before, after)| {
            before.iter().map(|channel| (0, channel)).chain(after.iter().map(|channel| (1, channel)))
        })
        .map(|(group, channel)| line(group, channel))
        .collect();
    let top = lines.iter().flat_map(Series::points).map(|point| point[1]).fold(1.0, f64::max);
    let x = Axis::new("reflectance before; stretched value after (no reflectance)", [0.0, 1.0]);
    Chart::new(title, x, Axis::new("% of pixels per 0.01", [0.0, top]), lines)
}

fn draw(folder: &Path, sources: &[Source], references: &[LibrarySpectrum], quantity: &str) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let write = |name: &str, chart: &Chart| {
        let path = folder.join(name);
        std::fs::write(&path, chart.svg()).with_context(|| path.display().to_string())
    };
    let line = |group: usize, name: &str, points: Vec<[f64; 2]>| {
        Series::thin_line(name, chart::COLORS[group % chart::COLORS.len()], points)
    };
    let channels = || {
        let groups = sources.iter().enumerate();
        groups.flat_map(|(group, source)| source.channels.iter().map(move |channel| (group, source, channel)))
    };

    let middle = |i: usize| (i as f64 + 0.5) / N_INTERVALS as f64;
    let histogram = |(group, source, channel): (usize, &Source, &channel::Channel)| {
        let shares = channel.histogram(N_INTERVALS);
        let points = shares.iter().enumerate().map(|(i, share)| [middle(i), share * 100.0]);
        line(group, &source.name, points.collect())
    };
    let lines: Vec<Series> = channels().map(histogram).collect();
    let top = lines.iter().flat_map(Series::points).map(|point| point[1]).fold(1.0, f64::max);
    let (x, y) = (Axis::new(quantity, [0.0, 1.0]), Axis::new("% of pixels per 0.01", [0.0, top]));
    write("histogram.svg", &Chart::new("Histograms, one line for each channel", x, y, lines))?;

    let nm = |channel: &channel::Channel| f64::from(channel.wavelength_nm);
    let low = channels().map(|(.., channel)| nm(channel)).fold(f64::INFINITY, f64::min) - 5.0;
    let high = channels().map(|(.., channel)| nm(channel)).fold(0.0, f64::max) + 5.0;
    let wavelengths = Axis::new("wavelength, nm", [low, high]);
    let mut lines = Vec::new();
    for (group, source) in sources.iter().enumerate() {
        let values = |value: fn(&channel::Channel) -> Option<f64>| {
            let points = source.channels.iter().filter_map(|channel| Some([nm(channel), value(channel)?]));
            line(group, &source.name, points.collect())
        };
        lines.extend([values(channel::Channel::min), values(channel::Channel::mean), values(channel::Channel::max)]);
        // Bars of several inputs stand beside each other.
        let aside = (high - low) * 0.006 * group as f64;
        let bar = |channel: &channel::Channel| {
            let (mean, deviation, at) = (channel.mean()?, channel.deviation()?, nm(channel) + aside);
            Some(line(group, &source.name, vec![[at, mean - deviation], [at, mean + deviation]]))
        };
        lines.extend(source.channels.iter().filter_map(bar));
    }
    let values = || lines.iter().flat_map(Series::points).map(|point| point[1]);
    let ends = [values().fold(0.0, f64::min), values().fold(0.1, f64::max) * 1.02];
    let title = "Minimum, mean and maximum; bars: standard deviation";
    write("distribution.svg", &Chart::new(title, wavelengths.clone(), Axis::new(quantity, ends), lines))?;

    if sources.iter().any(|source| source.signature.iter().any(|moments| moments.n > 0)) {
        let mut lines = Vec::new();
        for (group, source) in sources.iter().enumerate() {
            let both = || source.channels.iter().zip(&source.signature).filter(|(_, moments)| moments.n > 0);
            let means = both().map(|(channel, moments)| [nm(channel), moments.mean()]);
            lines.push(line(group, &source.name, means.collect()));
            lines.extend(both().map(|(channel, moments)| {
                let ends = [moments.mean() - moments.deviation(), moments.mean() + moments.deviation()];
                line(group, &source.name, ends.map(|end| [nm(channel), end]).into())
            }));
        }
        let nearest = sources.first().map(|source| matches(source, references)).unwrap_or_default();
        if let Some(known) = nearest.first().and_then(|m| references.iter().find(|known| known.name == m.name)) {
            let points =
                (low as u32..=high as u32).filter_map(|nm| Some([f64::from(nm), reference::at(known, nm as f32)?]));
            lines.push(line(sources.len(), &known.name, points.collect()));
        }
        let title = "Signature of the region; bars: standard deviation";
        write("signature.svg", &Chart::new(title, wavelengths, Axis::new("reflectance", [0.0, 1.0]), lines))?;
    }
    Ok(())
}
