//! `replica-lab spectrum materials`: materials and vegetation index of each pixel of a cube.

mod picture;
mod relative;

use crate::sensor_calibration;
use anyhow::{Context, ensure};
use clap::builder::PossibleValuesParser;
use command_line::answer::Answer;
use command_line::argument::rectangle;
use formats::band_image::{self, BandImage};
use materials::{Classifier, Method, Model, Places, Probabilities, Smoothing, Spectra, best_row, materials_of, ndvi};
use messages::{MaterialId, MaterialRow};
use pictures::bands::source::Region;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Distance of the centers of two cells for the smoothing, m: the cell size of the mosaic cameras at 15 m.
const CELL_M: f32 = 0.1;

/// Show the materials of a cube.
///
/// Writes for each cube `NAME_materials.png`, `NAME_ndvi.png` if it has red and near infrared, and `NAME_spectra.svg`, the mean
/// spectrum of each material or region with the nearest references. The table shows the share of each material.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab spectrum materials cubes/frame.hdr --out materials")]
pub struct Args {
    /// ENVI cubes of reflectances, or TIFFs with one sample per band (see --sensor)
    #[arg(required = true, value_name = "CUBE.hdr|CUBE.tif")]
    inputs: Vec<PathBuf>,
    /// Folder for the results; created if absent
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Calibration file of the manufacturer. Without a white reference, samples of TIFFs are divided by the response of the
    /// filters to sunlight: spectra are then correct up to a factor and the color of the light
    #[arg(long, value_name = "XML")]
    sensor: Option<PathBuf>,
    /// Region to compare with the references: left column, top row, columns, rows, in cells. Several are possible
    #[arg(long, value_name = "X,Y,W,H", value_parser = rectangle::<usize>)]
    region: Vec<Region>,
    /// How spectra are compared with the references [default: learned; angle for TIFFs, whose noise and light differ from the
    /// training data]
    #[arg(long, value_parser = PossibleValuesParser::new(Method::ALL.map(Method::name)))]
    method: Option<String>,
    /// Classify every pixel independently of its neighbors
    #[arg(long)]
    no_smoothing: bool,
    #[command(flatten)]
    answer: Answer,
}

/// Materials of a cube.
#[derive(Serialize)]
struct CubeMaterials {
    cube: String,
    /// Materials with their shares of the pixels.
    materials: Vec<(&'static str, f64)>,
    /// Median of the pixels with a vegetation index.
    median_ndvi: Option<f32>,
    regions: Vec<RegionMaterials>,
}

/// Materials of a region.
#[derive(Serialize)]
struct RegionMaterials {
    region: Region,
    /// The most frequent material and its share.
    material: (&'static str, f64),
    mean_ndvi: Option<f32>,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let sensor = args.sensor.as_deref().map(sensor_calibration::read).transpose()?;
    let model = Model::built_in()?;
    let mut found = Vec::new();
    for path in &args.inputs {
        let about = || path.display().to_string();
        let mut image = band_image::read(path)?;
        let is_relative = image.wavelengths_nm.is_empty();
        if is_relative {
            let sensor =
                sensor.as_ref().with_context(about).context("the wavelengths are unknown\nhint: --sensor XML")?;
            image = relative::reflectances(&image, sensor).with_context(about)?;
        }
        ensure!(image.n_bands <= 64, "{}: {} bands; at most 64 are possible", path.display(), image.n_bands);
        let asked = Method::ALL.into_iter().find(|method| Some(method.name()) == args.method.as_deref());
        let method = asked.unwrap_or(if is_relative { Method::Angle } else { Method::default() });
        found.push(one(args, &model, method, path, &image)?);
    }
    args.answer.print(&found, || found.iter().map(CubeMaterials::text).collect())?;
    Ok(ExitCode::SUCCESS)
}

fn one(
    args: &Args,
    model: &Model,
    method: Method,
    path: &std::path::Path,
    image: &BandImage,
) -> anyhow::Result<CubeMaterials> {
    let spectra = spectra_of(image);
    let [columns, _] = image.size;
    let cell = |i: usize| [(i % columns) as f32 * CELL_M, (i / columns) as f32 * CELL_M, 0.0];
    let positions: Vec<[f32; 3]> = (0..spectra.len()).map(cell).collect();
    let smoothing = if args.no_smoothing { Smoothing::Off } else { Smoothing::default() };
    let classifier = Classifier::new(model, &image.wavelengths_nm, method);
    let places = Places { positions: &positions, regions: None };
    let found: Vec<Probabilities> = materials_of(&classifier, &spectra, places, smoothing);
    let rows: Vec<MaterialRow> = found.iter().map(best_row).collect();
    let index: Vec<Option<f32>> = (0..spectra.len()).map(|i| ndvi(spectra.get(i))).collect();

    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let file = |what: &str| args.out.join(format!("{name}_{what}"));
    picture::materials(image.size, &rows, &args.region, &file("materials.png"))?;
    if index.iter().any(Option::is_some) {
        picture::index(image.size, &index, &file("ndvi.png"))?;
    }
    let chart = picture::spectra(model, &spectra, &rows, image.size, &args.region);
    let svg = file("spectra.svg");
    std::fs::write(&svg, chart.svg()).with_context(|| svg.display().to_string())?;

    let all: Vec<usize> = (0..rows.len()).collect();
    let regions = args.region.iter().map(|region| {
        let cells = picture::cells(image.size, *region);
        let material = shares(&rows, &cells).first().copied().unwrap_or(("unknown", 0.0));
        let known: Vec<f32> = cells.iter().filter_map(|i| index[*i]).collect();
        let mean = known.iter().sum::<f32>() / known.len() as f32;
        RegionMaterials { region: *region, material, mean_ndvi: (!known.is_empty()).then_some(mean) }
    });
    let mut known: Vec<f32> = index.iter().filter_map(|index| *index).collect();
    known.sort_by(f32::total_cmp);
    Ok(CubeMaterials {
        cube: path.display().to_string(),
        materials: shares(&rows, &all),
        median_ndvi: known.get(known.len() / 2).copied(),
        regions: regions.collect(),
    })
}

/// The pixels as spectra.
fn spectra_of(image: &BandImage) -> Spectra {
    let mut spectra = Spectra::new(&image.wavelengths_nm);
    let n = image.size[0] * image.size[1];
    let mut values = vec![0.0; image.n_bands];
    for pixel in 0..n {
        let mut valid = 0;
        for (band, value) in values.iter_mut().enumerate() {
            *value = image.values[band * n + pixel];
            valid |= u64::from(value.is_finite()) << band;
        }
        spectra.push(valid, &values);
    }
    spectra
}

/// Materials of some pixels with their shares, the most frequent first.
fn shares(rows: &[MaterialRow], pixels: &[usize]) -> Vec<(&'static str, f64)> {
    let count = |id: &MaterialId| pixels.iter().filter(|i| rows[**i].material_id == *id as u8).count();
    let n = pixels.len().max(1) as f64;
    let mut shares: Vec<(&str, f64)> = MaterialId::ALL.iter().map(|id| (id.name(), count(id) as f64 / n)).collect();
    shares.retain(|(_, share)| *share > 0.0);
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares
}

impl CubeMaterials {
    fn text(&self) -> String {
        let mut text = format!("{}\n\n| material | share of the pixels, % |\n|---|---:|\n", self.cube);
        for (name, share) in &self.materials {
            let _ = writeln!(text, "| {name} | {:.1} |", 100.0 * share);
        }
        if let Some(index) = self.median_ndvi {
            let _ = writeln!(text, "\nMedian vegetation index: {index:.2}");
        }
        if !self.regions.is_empty() {
            text += "\n| region | material | share, % | mean NDVI |\n|---|---|---:|---:|\n";
        }
        for RegionMaterials { region: [x, y, w, h], material: (name, share), mean_ndvi } in &self.regions {
            let index = mean_ndvi.map_or_else(|| "-".to_owned(), |index| format!("{index:.2}"));
            let _ = writeln!(text, "| {x},{y},{w},{h} | {name} | {:.0} | {index} |", 100.0 * share);
        }
        text + "\n"
    }
}
