//! An image of the command, and its results.

use crate::cube::UNKNOWN;
use anyhow::Context;
use color_lines::Image;
use formats::band_image::{self, BandImage};
use formats::envi::{self, Header};
use image::{ImageBuffer, Luma, RgbImage};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// An image with its file.
pub struct Frame {
    pub path: PathBuf,
    /// Name of the file without its extension.
    pub name: String,
    pub bands: BandImage,
    /// Whether the image has 8 bits of red, green and blue instead of being a cube.
    is_color: bool,
}

impl Frame {
    /// Reads PNG and JPEG as color, everything else as a cube.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let ending = path.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default();
        let is_color = ["png", "jpg", "jpeg"].iter().any(|known| ending == *known);
        let bands = if is_color {
            let image = image::open(path).with_context(|| path.display().to_string())?.to_rgb8();
            BandImage {
                size: [image.width() as usize, image.height() as usize],
                n_bands: 3,
                wavelengths_nm: Vec::new(),
                values: color_lines::band_sequential(image.as_raw(), 3),
            }
        } else {
            band_image::read(path)?
        };
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { path: path.to_owned(), name, bands, is_color })
    }

    pub fn image(&self) -> anyhow::Result<Image<'_>> {
        let BandImage { size, n_bands, values, .. } = &self.bands;
        Image::new(*size, *n_bands, values).with_context(|| self.path.display().to_string())
    }

    /// PSNR and MSE of a result, as cells of a table. The peak is 255 for 8 bits, and the largest value for a cube.
    pub fn fidelity(&self, values: &[f32]) -> anyhow::Result<String> {
        let peak = if self.is_color { 255.0 } else { f64::from(self.image()?.largest()) };
        let found = scores::fidelity(&self.bands.values, values, self.bands.n_bands, peak);
        let found = found.with_context(|| format!("{}: no valid pixel", self.path.display()))?;
        Ok(format!("{:.2} | {:.4}", found.psnr_db, found.squared_error))
    }

    /// Writes an image with the bands of this one.
    pub fn write(&self, folder: &Path, what: &str, values: &[f32]) -> anyhow::Result<()> {
        let [columns, rows] = self.bands.size;
        let stem = format!("{}_{what}", self.name);
        if !self.is_color {
            let mut header = Header::new(columns, rows, self.bands.n_bands);
            header.wavelengths = self.bands.wavelengths_nm.iter().map(|nm| f64::from(*nm)).collect();
            if !header.wavelengths.is_empty() {
                "nm".clone_into(&mut header.wavelength_units);
            }
            header.data_ignore_value = Some(UNKNOWN);
            let values = values.iter().map(|value| if value.is_finite() { *value } else { UNKNOWN }).collect();
            return Ok(envi::write(&folder.join(stem + ".hdr"), &envi::Image { header, values })?);
        }
        let n = columns * rows;
        let pixel = |x: u32, y: u32| {
            let at = y as usize * columns + x as usize;
            image::Rgb([0, 1, 2].map(|band| values[band * n + at].round() as u8))
        };
        let path = folder.join(stem + ".png");
        RgbImage::from_fn(columns as u32, rows as u32, pixel).save(&path).with_context(|| path.display().to_string())
    }

    /// Writes labels as a gray image of 16 bits.
    pub fn write_labels(&self, folder: &Path, labels: &[u32]) -> anyhow::Result<()> {
        let [columns, rows] = self.bands.size;
        let path = folder.join(format!("{}_labels.png", self.name));
        let pixel = |x: u32, y: u32| Luma([labels[y as usize * columns + x as usize] as u16]);
        let image: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::from_fn(columns as u32, rows as u32, pixel);
        image.save(&path).with_context(|| path.display().to_string())
    }
}
