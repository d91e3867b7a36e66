//! Pictures of a survey: points over images, sweeps over each other, yaw rates.

mod from_above;
mod overlay;
mod page;
mod yaw_rates;

pub use overlay::{DEPTH_M, ImagePoint, draw_points};

use crate::check::Report;
use crate::error::RigError;
use crate::survey::Survey;
use drive::Drive;
use image::RgbImage;
use std::fs;
use std::path::Path;

/// A picture and its place in the page.
pub struct Picture {
    /// Name of its file.
    pub file: String,
    /// Caption of the picture.
    pub caption: String,
    content: Content,
}

enum Content {
    Pixels(RgbImage),
    Svg(String),
}

/// Writes all pictures of a survey and `rig.html`, the page that shows them with the verdicts, to a folder; returns their number.
pub fn write(folder: &Path, drive: &Drive, survey: &Survey, report: &Report) -> Result<usize, RigError> {
    fs::create_dir_all(folder).map_err(|error| RigError::io(folder, error))?;
    let mut pictures = overlay::pictures(drive, survey);
    pictures.extend(from_above::pictures(drive, survey));
    pictures.extend(yaw_rates::picture(survey));
    for picture in &pictures {
        let path = folder.join(&picture.file);
        match &picture.content {
            Content::Pixels(pixels) => {
                let saved = pixels.save(&path);
                saved.map_err(|error| RigError::source(&path, "", error.to_string()))?;
            }
            Content::Svg(text) => fs::write(&path, text).map_err(|error| RigError::io(&path, error))?,
        }
    }
    let path = folder.join("rig.html");
    let page = page::html(drive, survey, report, &pictures);
    fs::write(&path, page).map_err(|error| RigError::io(&path, error))?;
    Ok(pictures.len())
}

/// Draws a square of `side` pixels around a position, clipped at the border.
fn dot(image: &mut RgbImage, [u, v]: [f64; 2], side: i64, color: [u8; 3]) {
    let left = (u - 0.5 * (side - 1) as f64).round() as i64;
    let top = (v - 0.5 * (side - 1) as f64).round() as i64;
    for y in top.max(0)..(top + side).min(i64::from(image.height())) {
        for x in left.max(0)..(left + side).min(i64::from(image.width())) {
            image.put_pixel(x as u32, y as u32, image::Rgb(color));
        }
    }
}
