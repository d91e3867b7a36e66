//! Tables 3.3 and 3.4: regions of Gaussians for spatial weights 0 to 1, and SLIC, on the training images of BSDS500.

use super::bsds::{Example, training_images};
use super::{cell, inputs_or};
use anyhow::{Context, ensure};
use color_lines::{Model, Settings, Start, slic};
use rayon::prelude::*;
use scores::regions::{LabelImage, boundary_scores, contour_density, explained_variation, overlap_scores, shapes};
use std::path::PathBuf;

/// Gaussians of an image, as in the thesis.
const N_REGIONS: usize = 150;
/// Cells of the histogram along its longest axis: with fewer, many images have less than 150 maxima of their colors.
const BINS: usize = 128;
/// Superpixels that SLIC starts with, so that about as many remain.
const N_GRID: usize = 200;
/// Compactness of SLIC, as its authors recommend for Lab.
const COMPACTNESS: f64 = 10.0;
/// Distance of boundaries that count as equal, px (thesis).
const DISTANCE: usize = 2;
/// Distance of boundaries that count as equal in the superpixel benchmark, as a share of the diagonal.
const SHARE_OF_DIAGONAL: f64 = 0.0025;

/// A row of the tables.
#[derive(Clone, Copy)]
enum Method {
    /// Gaussians with a spatial weight.
    Gaussians(f64),
    Slic,
    /// The whole image as one region: the worst possible overlap.
    OneRegion,
}

const METHODS: [Method; 8] = [
    Method::Gaussians(0.0),
    Method::Gaussians(0.2),
    Method::Gaussians(0.4),
    Method::Gaussians(0.6),
    Method::Gaussians(0.8),
    Method::Gaussians(1.0),
    Method::Slic,
    Method::OneRegion,
];

/// Scores of one image; scores against segmentations are means over the segmentations. "sum": of the squared error summed over
/// bands.
const NAMES: [&str; 17] = [
    "PSNR",
    "PSNR, sum",
    "extent",
    "solidity",
    "R",
    "P",
    "DE, one side",
    "CO",
    "US (NP)",
    "US (Bergh)",
    "R 0.0025",
    "P 0.0025",
    "DE, both sides",
    "ASA",
    "EV",
    "regions",
    "parts",
];
/// The columns of each table.
const TABLES: [(&str, std::ops::Range<usize>); 4] = [
    ("Table 3.3", 0..4),
    ("Table 3.4", 4..9),
    ("Superpixel benchmark", 9..15),
    ("Regions and their connected parts", 15..17),
];

/// Prints the tables.
pub fn superpixels(inputs: &[PathBuf], limit: Option<usize>) -> anyhow::Result<()> {
    let inputs = inputs_or(inputs, &["bsds500"])?;
    let folder = inputs.first().context("no folder")?;
    let mut paths = training_images(folder)?;
    paths.truncate(limit.unwrap_or(usize::MAX));
    ensure!(!paths.is_empty(), "{}: no images", folder.display());
    let rows = paths
        .par_iter()
        .map(|path| {
            let example = Example::read(folder, path)?;
            METHODS.iter().map(|method| scores(&example, *method)).collect()
        })
        .collect::<anyhow::Result<Vec<Vec<[f64; NAMES.len()]>>>>()?;
    println!("{} images, mean ± standard deviation\n", paths.len());
    for (title, columns) in TABLES {
        println!("{title}\n\n| | {} |\n|---|{}", NAMES[columns.clone()].join(" | "), "---:|".repeat(columns.len()));
        for (number, method) in METHODS.iter().enumerate() {
            let of_column = |column| cell(&rows.iter().map(|of| of[number][column]).collect::<Vec<_>>());
            let cells: Vec<String> = columns.clone().map(of_column).collect();
            let name = match method {
                Method::Gaussians(weight) => format!("s = {weight:.1}"),
                Method::Slic => "SLIC".to_owned(),
                Method::OneRegion => "one region".to_owned(),
            };
            println!("| {name} | {} |", cells.join(" | "));
        }
        println!();
    }
    Ok(())
}

fn scores(example: &Example, method: Method) -> anyhow::Result<[f64; NAMES.len()]> {
    let image = &example.image;
    let labels = match method {
        Method::Gaussians(spatial_weight) => {
            let settings =
                Settings { start: Start::Count(N_REGIONS), bins: BINS, spatial_weight, ..Settings::default() };
            Model::fit(&image.image()?, &settings)?.labels
        }
        Method::Slic => slic(image.size, &image.rgb, N_GRID, COMPACTNESS),
        Method::OneRegion => vec![1; image.rgb.len()],
    };
    let regions = LabelImage::new(image.size[0], &labels).context("labels without an image")?;
    let fidelity = image.fidelity(&means(&labels, &image.values))?;
    let shape = shapes(&regions);
    let [width, height] = image.size.map(|side| side as f64);
    let distance = (SHARE_OF_DIAGONAL * width.hypot(height)).round() as usize;
    let n = example.segmentations.len() as f64;
    let mut mean = [0.0; 7];
    for segmentation in &example.segmentations {
        let truth = LabelImage::new(image.size[0], &segmentation.labels).context("segmentation without an image")?;
        let near = boundary_scores(&regions, &truth, DISTANCE);
        let nearest = boundary_scores(&regions, &truth, distance);
        let overlap = overlap_scores(&regions, &truth);
        let found = [
            near.recall,
            near.precision,
            overlap.under_segmentation_np,
            overlap.under_segmentation_bergh,
            nearest.recall,
            nearest.benchmark_precision,
            overlap.achievable_accuracy,
        ];
        mean.iter_mut().zip(found).for_each(|(mean, value)| *mean += value / n);
    }
    let [recall, precision, under_np, under_bergh, benchmark_recall, benchmark_precision, accuracy] = mean;
    let density = contour_density(&regions);
    Ok([
        fidelity.psnr_db,
        fidelity.psnr_db - 10.0 * 3.0_f64.log10(),
        shape.extent,
        shape.solidity,
        recall,
        precision,
        density.one_side,
        shape.compactness,
        under_np,
        under_bergh,
        benchmark_recall,
        benchmark_precision,
        density.both_sides,
        accuracy,
        explained_variation(&regions, &image.values),
        regions.n_regions() as f64,
        regions.n_parts() as f64,
    ])
}

/// Each pixel as the mean of its region.
fn means(labels: &[u32], values: &[f32]) -> Vec<f32> {
    let n_labels = labels.iter().max().map_or(0, |label| *label as usize + 1);
    let mut simplified = Vec::with_capacity(values.len());
    for band in values.chunks_exact(labels.len()) {
        let mut sums = vec![(0.0, 0.0); n_labels];
        for (label, value) in labels.iter().zip(band) {
            let (sum, n) = &mut sums[*label as usize];
            *sum += f64::from(*value);
            *n += 1.0;
        }
        simplified.extend(labels.iter().map(|label| {
            let (sum, n) = sums[*label as usize];
            (sum / n) as f32
        }));
    }
    simplified
}
