//! Tables 3.5 and 3.6: hyperspectral cubes.

use super::inputs_or;
use anyhow::Context;
use color_lines::{Image, Model, Settings, Start};
use std::path::PathBuf;

/// As in most experiments of the thesis.
const CONTRAST: f64 = 3.0;

/// Prints the tables.
pub fn cubes(inputs: &[PathBuf]) -> anyhow::Result<()> {
    let inputs = inputs_or(inputs, &["photonfocus/frame_02245_nir.tif", "photonfocus/frame_02245_vis.tif"])?;
    let (mut approaches, mut variants) = (String::new(), String::new());
    for path in &inputs {
        let cube = formats::band_image::read(path)?;
        let image = Image::new(cube.size, cube.n_bands, &cube.values).with_context(|| path.display().to_string())?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let psnr = |settings: &Settings| {
            let fit = Model::fit(&image, settings)?;
            let simplified = fit.model.simplified(&image, &fit.labels)?;
            let found = scores::fidelity(&cube.values, &simplified, cube.n_bands, f64::from(image.largest()));
            Ok::<_, anyhow::Error>((fit.model.regions.len(), found.context("no pixel to compare")?.psnr_db))
        };
        let at_maxima = Settings { hemispheres: 1, start: Start::Contrast(CONTRAST), ..Settings::default() };
        let (n, second) = psnr(&at_maxima)?;
        let (_, first) = psnr(&Settings { start: Start::KMeans(n, 1), ..at_maxima })?;
        let third = |constrained| Settings { start: Start::Count(n), constrained, ..Settings::default() };
        let constrained = psnr(&third(true))?.1;
        approaches += &format!("| {name} | {n} | {first:.2} | {second:.2} | {constrained:.2} |\n");
        let mut cells = Vec::new();
        for spatial_weight in [0.0, 1.0] {
            for constrained in [true, false] {
                cells.push(format!("{:.2}", psnr(&Settings { spatial_weight, ..third(constrained) })?.1));
            }
        }
        variants += &format!("| {name} | {n} | {} |\n", cells.join(" | "));
    }
    println!("Table 3.5, PSNR, dB\n\n| cube | Gaussians | approach 1 | approach 2 | approach 3 |\n|---|{}\n{approaches}", "---:|".repeat(4));
    println!("Table 3.6, PSNR, dB\n\n| cube | Gaussians | S, C | S, NO-C | S-XY, C | S-XY, NO-C |\n|---|{}\n{variants}", "---:|".repeat(5));
    Ok(())
}
