//! Decodes camera files directly into memory of the caller.

use super::jpeg::{is_complete, is_jpeg};
use formats::manifest::{CameraEntry, MosaicEntry};
use formats::pgm::{Pgm, PgmError};
use image::{ColorType, DynamicImage, ImageDecoder, ImageError, ImageReader};
use std::io::{self, Cursor};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// A damaged camera file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct CameraFileError {
    path: PathBuf,
    source: CameraFileFault,
}

/// What is wrong with a camera file.
#[derive(Debug, thiserror::Error)]
enum CameraFileFault {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Pgm(#[from] PgmError),
    #[error("the image decoder cannot handle the damage of the file")]
    Decoder,
    #[error("{} x {} px, the camera has {} x {}", found[0], found[1], expected[0], expected[1])]
    Size { found: [u32; 2], expected: [u32; 2] },
    #[error("the JPEG data ends after {n_bytes} bytes without the end of the image; the file is cut")]
    Cut { n_bytes: usize },
    #[error("samples up to {max}, must be up to {limit} for a bit depth of {bit_depth}")]
    Depth { max: u32, limit: u32, bit_depth: u32 },
}

/// Decodes a color image of the camera. `pixels` has three bytes for each pixel of the camera.
pub fn image_into(path: &Path, entry: &CameraEntry, pixels: &mut [u8]) -> Result<(), CameraFileError> {
    let mut decoded = || -> Result<(), CameraFileFault> {
        let bytes = std::fs::read(path)?;
        let decoder = ImageReader::new(Cursor::new(&bytes)).with_guessed_format()?.into_decoder()?;
        check_size(decoder.dimensions(), entry.model.size())?;
        if is_jpeg(&bytes) && !is_complete(&bytes) {
            return Err(CameraFileFault::Cut { n_bytes: bytes.len() });
        }
        // The decoder of a damaged file may leave rows unwritten.
        pixels.fill(0);
        if decoder.color_type() == ColorType::Rgb8 {
            guarded(|| decoder.read_image(pixels))?;
        } else {
            let image = guarded(|| DynamicImage::from_decoder(decoder))?;
            pixels.copy_from_slice(image.to_rgb8().as_raw());
        }
        Ok(())
    };
    decoded().map_err(|source| CameraFileError { path: path.to_owned(), source })
}

/// The result of a decoder. Decoders of images panic on some damaged files (`tests/fuzz_targets/corpus/jpeg`).
fn guarded<T>(decode: impl FnOnce() -> Result<T, ImageError>) -> Result<T, CameraFileFault> {
    match catch_unwind(AssertUnwindSafe(decode)) {
        Ok(result) => Ok(result?),
        Err(_) => Err(CameraFileFault::Decoder),
    }
}

/// Decodes a raw mosaic of the camera. `samples` has one value for each pixel of the camera.
pub fn mosaic_into(path: &Path, entry: &MosaicEntry, samples: &mut [u16]) -> Result<(), CameraFileError> {
    let mut decoded = || -> Result<(), CameraFileFault> {
        let bytes = std::fs::read(path)?;
        let pgm = Pgm::parse(&bytes)?;
        check_size((pgm.width, pgm.height), entry.model.size())?;
        let (bit_depth, limit) = (entry.bit_depth, (1_u32 << entry.bit_depth.min(16)) - 1);
        if pgm.max > limit {
            return Err(CameraFileFault::Depth { max: pgm.max, limit, bit_depth });
        }
        pgm.samples_into(samples);
        Ok(())
    };
    decoded().map_err(|source| CameraFileError { path: path.to_owned(), source })
}

/// The manifest has the camera's size, so the header of a file cannot make the caller allocate more.
fn check_size(found: (u32, u32), expected: (u32, u32)) -> Result<(), CameraFileFault> {
    if found == expected {
        return Ok(());
    }
    Err(CameraFileFault::Size { found: found.into(), expected: expected.into() })
}
