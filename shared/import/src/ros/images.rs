//! Images of a camera as files.

mod pixels;

use super::messages::{CompressedImage, Image};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use pixels::Pixels;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::PathBuf;

/// Writes the images of a topic.
pub(crate) struct Images {
    folder: PathBuf,
    pub n_written: u64,
    /// Images with the stamp of another image.
    pub n_same_stamp: u64,
    /// Whether images lost bits.
    pub is_reduced: bool,
    /// Size of all images, if the messages state it.
    pub size: Option<[u32; 2]>,
}

impl Images {
    /// Writer to `folder`, which must exist.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, n_written: 0, n_same_stamp: 0, is_reduced: false, size: None }
    }

    /// Writes a PNG without loss.
    pub fn add(&mut self, stamp: i64, image: &Image<'_>) -> Result<(), String> {
        let size = [image.width, image.height];
        match self.size {
            Some([w, h]) if [w, h] != size => {
                return Err(format!("{} x {} pixels; the previous images have {w} x {h}", size[0], size[1]));
            }
            _ => self.size = Some(size),
        }
        self.is_reduced |= pixels::is_reduced(&image.encoding);
        let content = png(image)?;
        self.write(stamp, "png", &content)
    }

    /// Writes the bytes unchanged.
    pub fn add_compressed(&mut self, stamp: i64, image: &CompressedImage<'_>) -> Result<(), String> {
        self.write(stamp, compressed_extension(image)?, image.data)
    }

    fn write(&mut self, stamp: i64, extension: &str, content: &[u8]) -> Result<(), String> {
        let path = self.folder.join(format!("{stamp:019}.{extension}"));
        match File::create_new(&path).and_then(|mut file| file.write_all(content)) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                self.n_same_stamp += 1;
                Ok(())
            }
            written => {
                self.n_written += 1;
                written.map_err(|error| format!("{}: {error}", path.display()))
            }
        }
    }

    /// Removes the images of a camera that is left out.
    pub fn discard(&self) -> io::Result<()> {
        fs::remove_dir_all(&self.folder)
    }
}

/// The image as PNG, without loss except for 16 bits.
pub(crate) fn png(image: &Image<'_>) -> Result<Vec<u8>, String> {
    let (pixels, color) = match pixels::from_image(image)? {
        Pixels::Gray(pixels) => (pixels, ExtendedColorType::L8),
        Pixels::Rgb(pixels) => (pixels, ExtendedColorType::Rgb8),
    };
    let mut content = Vec::new();
    // Better compression takes several times as long.
    let encoder = PngEncoder::new_with_quality(&mut content, CompressionType::Fast, FilterType::Sub);
    encoder.write_image(&pixels, image.width, image.height, color).map_err(|error| error.to_string())?;
    Ok(content)
}

/// The raw samples of an image of one channel as PGM, for a mosaic camera.
pub(crate) fn pgm(image: &Image<'_>) -> Result<Vec<u8>, String> {
    let samples = pixels::raw_samples(image)?;
    // A message does not state the bit depth of its samples, and a live run refuses a larger depth than the camera has:
    // the smallest depth that holds all samples is used. Above 255, samples have two bytes.
    let largest = samples.big_endian.as_chunks::<2>().0.iter().map(|bytes| u16::from_be_bytes(*bytes)).max();
    let wide = || largest.unwrap_or(0).max(0x1ff);
    let max = if samples.is_wide { u16::MAX >> wide().leading_zeros() } else { u16::from(u8::MAX) };
    let head = format!("P5 {} {} {max}\n", image.width, image.height);
    Ok([head.as_bytes(), &samples.big_endian].concat())
}

/// Extension of a file of this content.
pub(crate) fn compressed_extension(image: &CompressedImage<'_>) -> Result<&'static str, String> {
    if image.data.starts_with(&[0xff, 0xd8, 0xff]) {
        Ok("jpg")
    } else if image.data.starts_with(b"\x89PNG\r\n\x1a\n") {
        Ok("png")
    } else {
        Err(format!("format {:?}: the data are neither JPEG nor PNG", image.format))
    }
}
