//! Table 3.1 and figure 3.11: straight and graph-based color lines of color images.

use super::{ColorImage, inputs_or};
use color_lines::{Model, Settings, StraightLines, project_onto_straight_lines};
use scores::Fidelity;
use std::path::PathBuf;

/// Numbers of hemispheres and of lines of the figure.
const HEMISPHERES: [usize; 9] = [1, 2, 4, 6, 8, 10, 15, 20, 40];
const LINES: [usize; 11] = [1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20];

/// PSNR and MSE, as table 3.1 has them.
fn cell(fidelity: Fidelity) -> String {
    format!("{:.2} ({:.0})", fidelity.psnr_db, fidelity.squared_error)
}

/// Prints the table and the figure of each image.
pub fn lines(inputs: &[PathBuf]) -> anyhow::Result<()> {
    let inputs = inputs_or(inputs, &["images/astronaut.png", "images/coffee.png"])?;
    let images = inputs.iter().map(|path| ColorImage::read(path)).collect::<Result<Vec<_>, _>>()?;
    let name = |path: &PathBuf| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    println!("PSNR, dB (MSE): Dynamic Color Lines; the best straight lines; Graph-based Color Lines\n");
    println!("| image | Gaussians | K | DCL | refined | GCL |\n|---|{}", "---:|".repeat(5));
    for (path, image) in inputs.iter().zip(&images) {
        let model = Model::fit(&image.image()?, &Settings::default())?.model;
        for n_lines in [3, 4, 5] {
            let straight = |method| {
                let projection = project_onto_straight_lines(&image.image()?, n_lines, method)?;
                image.fidelity(&projection.values).map(cell)
            };
            let graph = cell(image.fidelity(&model.projected(&image.image()?, n_lines)?.values)?);
            println!(
                "| {} | {} | {n_lines} | {} | {} | {graph} |",
                name(path),
                model.regions.len(),
                straight(StraightLines::Frequent)?,
                straight(StraightLines::Refined)?
            );
        }
    }
    for (path, image) in inputs.iter().zip(&images) {
        println!("\n{}: PSNR, dB, by hemispheres (rows) and lines\n", name(path));
        println!("| | {} |\n|---:|{}", LINES.map(|n| n.to_string()).join(" | "), "---:|".repeat(LINES.len()));
        for hemispheres in HEMISPHERES {
            let model = Model::fit(&image.image()?, &Settings { hemispheres, ..Settings::default() })?.model;
            let psnr = |n_lines| {
                Ok(format!("{:.1}", image.fidelity(&model.projected(&image.image()?, n_lines)?.values)?.psnr_db))
            };
            let cells = LINES.into_iter().map(psnr).collect::<anyhow::Result<Vec<_>>>()?;
            println!("| {hemispheres} | {} |", cells.join(" | "));
        }
    }
    Ok(())
}
