//! Decodes camera files directly into the caller's memory.

use drive::manifest::{CameraEntry, MosaicEntry};
use files::regular_file;
use formats::jpeg::{self, JpegError};
use formats::pgm::{Pgm, PgmError};
use image::{ColorType, DynamicImage, ImageDecoder, ImageError, ImageReader};
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

/// A damaged camera file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct CameraFileError {
    path: PathBuf,
    source: CameraFileFault,
}

/// The fault of a camera file.
#[derive(Debug, thiserror::Error)]
enum CameraFileFault {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Pgm(#[from] PgmError),
    #[error("the image decoder cannot handle the damage of the file: {0}")]
    Decoder(String),
    #[error("{} x {} px, the camera has {} x {}", found[0], found[1], expected[0], expected[1])]
    Size { found: [u32; 2], expected: [u32; 2] },
    #[error(transparent)]
    Jpeg(#[from] JpegError),
    #[error("samples up to {max}, must be up to {limit} for a bit depth of {bit_depth}")]
    Depth { max: u32, limit: u32, bit_depth: u32 },
}

impl CameraFileError {
    /// The decoder has panicked, with this text.
    pub fn decoder_panicked(path: &Path, text: String) -> Self {
        Self { path: path.to_owned(), source: CameraFileFault::Decoder(text) }
    }
}

/// Decodes a color image of the camera. `pixels` has three bytes for each pixel of the camera. The decoder panics on
/// some damaged files (`tests/fuzz_targets/corpus/jpeg`): callers must catch the panic, see
/// [`CameraFileError::decoder_panicked`].
pub fn image_into(path: &Path, entry: &CameraEntry, pixels: &mut [u8]) -> Result<(), CameraFileError> {
    let mut decoded = || -> Result<(), CameraFileFault> {
        let bytes = regular_file::read(path)?;
        let decoder = ImageReader::new(Cursor::new(&bytes)).with_guessed_format()?.into_decoder()?;
        check_size(decoder.dimensions(), entry.model.size())?;
        if jpeg::is_jpeg(&bytes) {
            jpeg::check(&bytes)?;
        }
        // The decoder of a damaged file may leave rows unwritten.
        pixels.fill(0);
        if decoder.color_type() == ColorType::Rgb8 {
            decoder.read_image(pixels)?;
        } else {
            let image = DynamicImage::from_decoder(decoder)?;
            pixels.copy_from_slice(image.to_rgb8().as_raw());
        }
        Ok(())
    };
    decoded().map_err(|source| CameraFileError { path: path.to_owned(), source })
}

/// Decodes a raw mosaic of the camera. `samples` has one value for each pixel of the camera.
pub fn mosaic_into(path: &Path, entry: &MosaicEntry, samples: &mut [u16]) -> Result<(), CameraFileError> {
    let mut decoded = || -> Result<(), CameraFileFault> {
        let bytes = regular_file::read(path)?;
        let pgm = Pgm::parse(&bytes)?;
        check_size((pgm.width, pgm.height), entry.model.size())?;
        let bit_depth = entry.bit_depth;
        let limit = (1_u32 << entry.bit_depth.min(16)) - 1;
        if pgm.max > limit {
            return Err(CameraFileFault::Depth { max: pgm.max, limit, bit_depth });
        }
        pgm.samples_into(samples);
        Ok(())
    };
    decoded().map_err(|source| CameraFileError { path: path.to_owned(), source })
}

/// Checks the size of an image. The manifest has the camera's size, so the header of a file cannot make the caller
/// allocate more.
fn check_size(found: (u32, u32), expected: (u32, u32)) -> Result<(), CameraFileFault> {
    if found == expected {
        return Ok(());
    }
    Err(CameraFileFault::Size { found: found.into(), expected: expected.into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panic_of_the_decoder_is_a_fault_of_the_file() {
        let error =
            CameraFileError::decoder_panicked(Path::new("camera/1/5.jpg"), "index 7 is out of bounds".to_owned());
        let expected =
            "camera/1/5.jpg: the image decoder cannot handle the damage of the file: index 7 is out of bounds";
        assert_eq!(error.to_string(), expected);
    }
}
