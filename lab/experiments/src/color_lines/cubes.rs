//! Tables 3.5 and 3.6: hyperspectral cubes.

use super::inputs_or;
use anyhow::Context;
use color_lines::{Image, Model, Settings, Start};
use std::path::PathBuf;

/// Gaussians of table 3.5 and of table 3.6, about as many as in the thesis.
const N_GAUSSIANS: [usize; 2] = [60, 150];
/// Cells of the histogram along its longest axis: with fewer, some cubes have too few maxima.
const BINS: usize = 128;

/// Prints the tables.
pub fn cubes(inputs: &[PathBuf]) -> anyhow::Result<()> {
    let inputs = inputs_or(inputs, &["photonfocus/frame_02245_nir.tif", "photonfocus/frame_02245_vis.tif"])?;
    let mut approaches = Vec::new();
    let mut variants = Vec::new();
    for path in &inputs {
        let cube = formats::band_image::read(path)?;
        let image = Image::new(cube.size, cube.n_bands, &cube.values).with_context(|| path.display().to_string())?;
        // Cubes of one moment have one name, in a folder for each camera.
        let name = path.components().rev().take(2).map(|part| part.as_os_str().to_string_lossy()).collect::<Vec<_>>();
        let name = name.into_iter().rev().collect::<Vec<_>>().join("/");
        let psnr = |settings: &Settings| {
            let fit = Model::fit(&image, settings)?;
            let simplified = fit.model.simplified(&image, &fit.labels)?;
            let found = scores::fidelity(&cube.values, &simplified, cube.n_bands, f64::from(image.largest()));
            Ok::<_, anyhow::Error>((fit.model.regions.len(), found.context("no pixel to compare")?.psnr_db))
        };
        let [first, second, third] = {
            let settings = Settings { start: Start::Count(N_GAUSSIANS[0]), bins: BINS, ..Settings::default() };
            let (n, second) = psnr(&Settings { hemispheres: 1, ..settings })?;
            let first = psnr(&Settings { hemispheres: 1, start: Start::KMeans(n, 1), ..settings })?;
            let third = psnr(&Settings { start: Start::Count(n), constrained: true, ..settings })?;
            [first, (n, second), third].map(|(n, psnr_db)| format!("{psnr_db:.2} ({n})"))
        };
        approaches.push(format!("| {name} | {first} | {second} | {third} |"));
        let mut cells = Vec::new();
        for spatial_weight in [0.0, 1.0] {
            for constrained in [true, false] {
                let start = Start::Count(N_GAUSSIANS[1]);
                let settings = Settings { start, spatial_weight, constrained, bins: BINS, ..Settings::default() };
                let (n, psnr_db) = psnr(&settings)?;
                cells.push(format!("{psnr_db:.2} ({n})"));
            }
        }
        variants.push(format!("| {name} | {} |", cells.join(" | ")));
    }
    let table = |title: &str, columns: &[&str], rows: &[String]| {
        let rule = "---:|".repeat(columns.len());
        println!(
            "{title}: PSNR in dB (regions)\n\n| cube | {} |\n|---|{rule}\n{}\n",
            columns.join(" | "),
            rows.join("\n")
        );
    };
    table("Table 3.5", &["approach 1", "approach 2", "approach 3"], &approaches);
    table("Table 3.6", &["S, C", "S, NO-C", "S-XY, C", "S-XY, NO-C"], &variants);
    Ok(())
}
