//! Chapter 3: Graph-based Color Lines. Nothing is trained; each table is computed from images that the user names.

mod bsds;
mod cubes;
mod lines;
mod mat_file;
mod superpixels;

pub use cubes::cubes;
pub use lines::lines;
pub use superpixels::superpixels;

use crate::statistics::mean_and_deviation;
use anyhow::Context;
use std::path::{Path, PathBuf};

/// The named files or folders, or the defaults in the data folder.
fn inputs_or(inputs: &[PathBuf], names: &[&str]) -> anyhow::Result<Vec<PathBuf>> {
    if !inputs.is_empty() {
        return Ok(inputs.to_vec());
    }
    let find =
        |name: &&str| real_data::find(name).with_context(|| format!("{name} is not in the data folder; use --input"));
    names.iter().map(find).collect()
}

/// A color image.
struct ColorImage {
    /// Columns and rows.
    size: [usize; 2],
    rgb: Vec<[u8; 3]>,
    /// Band-sequential.
    values: Vec<f32>,
}

impl ColorImage {
    /// The largest value of 8 bits.
    const PEAK: f64 = 255.0;

    fn read(path: &Path) -> anyhow::Result<Self> {
        let image = image::open(path).with_context(|| path.display().to_string())?.to_rgb8();
        let values = color_lines::band_sequential(image.as_raw(), 3);
        let size = [image.width() as usize, image.height() as usize];
        Ok(Self { size, rgb: image.pixels().map(|pixel| pixel.0).collect(), values })
    }

    fn image(&self) -> anyhow::Result<color_lines::Image<'_>> {
        Ok(color_lines::Image::new(self.size, 3, &self.values)?)
    }

    fn fidelity(&self, values: &[f32]) -> anyhow::Result<scores::Fidelity> {
        scores::fidelity(&self.values, values, 3, Self::PEAK).context("no pixel to compare")
    }
}

/// Mean and standard deviation as the thesis prints them.
fn cell(values: &[f64]) -> String {
    let (mean, deviation) = mean_and_deviation(values);
    format!("{mean:.4} ± {deviation:.4}")
}
