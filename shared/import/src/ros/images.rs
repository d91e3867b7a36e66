//! Images of a camera as files.

mod pixels;

use super::messages::{CompressedImage, Image};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use pixels::Pixels;
use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind};
use std::path::PathBuf;

/// Writes the images of a topic.
pub(crate) struct Images {
    folder: PathBuf,
    pub n_written: u64,
    /// Images with the stamp of another.
    pub n_same_stamp: u64,
    /// Whether images lost bits.
    pub is_reduced: bool,
    /// Size of all images, if the messages state it.
    pub size: Option<[u32; 2]>,
}

impl Images {
    /// `folder` exists.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, n_written: 0, n_same_stamp: 0, is_reduced: false, size: None }
    }

    /// Writes a PNG without loss.
    pub fn add(&mut self, stamp: i64, image: &Image<'_>) -> Result<(), String> {
        let size = [image.width, image.height];
        match self.size {
            Some([w, h]) if [w, h] != size => {
                return Err(format!("{} x {} pixels; the images before have {w} x {h}", size[0], size[1]));
            }
            _ => self.size = Some(size),
        }
        self.is_reduced |= pixels::is_reduced(&image.encoding);
        let (pixels, color) = match pixels::of_image(image)? {
            Pixels::Gray(pixels) => (pixels, ExtendedColorType::L8),
            Pixels::Rgb(pixels) => (pixels, ExtendedColorType::Rgb8),
        };
        let Some(file) = self.create(stamp, "png")? else { return Ok(()) };
        // Without loss; better compression takes several times as long.
        let encoder = PngEncoder::new_with_quality(BufWriter::new(file), CompressionType::Fast, FilterType::Sub);
        encoder.write_image(&pixels, image.width, image.height, color).map_err(|error| error.to_string())
    }

    /// Writes the bytes as they are.
    pub fn add_compressed(&mut self, stamp: i64, image: &CompressedImage<'_>) -> Result<(), String> {
        let extension = if image.data.starts_with(&[0xff, 0xd8, 0xff]) {
            "jpg"
        } else if image.data.starts_with(b"\x89PNG\r\n\x1a\n") {
            "png"
        } else {
            return Err(format!("format {:?}: the data are neither JPEG nor PNG", image.format));
        };
        let Some(mut file) = self.create(stamp, extension)? else { return Ok(()) };
        io::Write::write_all(&mut file, image.data).map_err(|error| error.to_string())
    }

    fn create(&mut self, stamp: i64, extension: &str) -> Result<Option<File>, String> {
        let path = self.folder.join(format!("{stamp:019}.{extension}"));
        match File::create_new(&path) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                self.n_same_stamp += 1;
                Ok(None)
            }
            file => {
                self.n_written += 1;
                file.map(Some).map_err(|error| format!("{}: {error}", path.display()))
            }
        }
    }

    /// Removes the images of a camera that is left out.
    pub fn discard(&self) -> io::Result<()> {
        fs::remove_dir_all(&self.folder)
    }
}
