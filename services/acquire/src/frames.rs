//! Publishes camera files, decoded directly into shared memory.

use formats::drive::Frame;
use formats::jpeg::{self, JpegError};
use formats::manifest::{CameraEntry, MosaicEntry};
use formats::pgm::Pgm;
use image::{ColorType, DynamicImage, ImageDecoder, ImageReader};
use messages::{ImageHeader, ImageTopic, MosaicHeader, MosaicTopic};
use stage::{Loan, Outputs, StepError};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Why a frame is not published.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FrameError {
    /// The file is damaged; it is skipped.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: FileFault,
    },
    /// The pipeline failed; the run ends.
    #[error(transparent)]
    Step(#[from] StepError),
}

/// What is wrong with a camera file.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FileFault {
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error(transparent)]
    Image(#[from] image::ImageError),
    #[error(transparent)]
    Pgm(#[from] formats::pgm::PgmError),
    #[error("the image decoder cannot handle the damage of the file: {0}")]
    Decoder(String),
    #[error("{} x {} px, the camera has {} x {}", found[0], found[1], expected[0], expected[1])]
    Size { found: [u32; 2], expected: [u32; 2] },
    #[error(transparent)]
    Jpeg(#[from] JpegError),
    #[error("samples up to {max}, must be up to {limit} for a bit depth of {bit_depth}")]
    Depth { max: u32, limit: u32, bit_depth: u32 },
}

fn file_fault(path: &Path, source: impl Into<FileFault>) -> FrameError {
    FrameError::File { path: path.to_owned(), source: source.into() }
}

/// Publishes a color image.
pub(crate) fn publish_image(frame: &Frame, entry: &CameraEntry, outputs: &mut Outputs) -> Result<(), FrameError> {
    let fault = |error: image::ImageError| file_fault(&frame.path, error);
    let io_fault = |error: std::io::Error| file_fault(&frame.path, error);
    let (width, height) = entry.model.size();
    let bytes = std::fs::read(&frame.path).map_err(io_fault)?;
    let reader = ImageReader::new(Cursor::new(&bytes)).with_guessed_format().map_err(io_fault)?;
    let decoder = reader.into_decoder().map_err(fault)?;
    check_size(&frame.path, decoder.dimensions(), (width, height))?;
    if jpeg::is_jpeg(&bytes) {
        jpeg::check(&bytes).map_err(|error| file_fault(&frame.path, error))?;
    }
    let n_bytes = width as usize * height as usize * 3;
    let mut loan: Loan<ImageTopic> = outputs.loan(n_bytes)?;
    let pixels = room(&mut loan, n_bytes)?;
    // The decoder of a damaged file may leave rows unwritten.
    pixels.fill(0);
    if decoder.color_type() == ColorType::Rgb8 {
        guarded(|| decoder.read_image(pixels)).map_err(|error| file_fault(&frame.path, error))?;
    } else {
        let image = guarded(|| DynamicImage::from_decoder(decoder)).map_err(|error| file_fault(&frame.path, error))?;
        pixels.copy_from_slice(image.to_rgb8().as_raw());
    }
    *loan.header_mut() =
        ImageHeader { camera: frame.camera as u32, width, height, channels: 3, exposure_nanos: entry.exposure_nanos };
    Ok(outputs.publish(loan, frame.stamp.0)?)
}

/// The result of a decoder. Decoders of images panic on some damaged files (`tests/fuzz_targets/corpus/jpeg`).
fn guarded<T>(decode: impl FnOnce() -> Result<T, image::ImageError>) -> Result<T, FileFault> {
    Ok(stage::catch_panic(decode).map_err(FileFault::Decoder)??)
}

/// Publishes a raw mosaic.
pub(crate) fn publish_mosaic(frame: &Frame, entry: &MosaicEntry, outputs: &mut Outputs) -> Result<(), FrameError> {
    let bytes = std::fs::read(&frame.path).map_err(|error| file_fault(&frame.path, error))?;
    let pgm = Pgm::parse(&bytes).map_err(|error| file_fault(&frame.path, error))?;
    let (width, height) = entry.model.size();
    check_size(&frame.path, (pgm.width, pgm.height), (width, height))?;
    let limit = (1_u32 << entry.bit_depth.min(16)) - 1;
    if pgm.max > limit {
        let fault = FileFault::Depth { max: pgm.max, limit, bit_depth: entry.bit_depth };
        return Err(file_fault(&frame.path, fault));
    }
    let mut loan: Loan<MosaicTopic> = outputs.loan(pgm.n_samples())?;
    pgm.samples_into(room(&mut loan, pgm.n_samples())?);
    *loan.header_mut() = MosaicHeader {
        camera: frame.camera as u32,
        width,
        height,
        bit_depth: entry.bit_depth,
        exposure_nanos: entry.exposure_nanos,
    };
    Ok(outputs.publish(loan, frame.stamp.0)?)
}

/// The manifest has the camera's size, so the header of a file cannot make the stage allocate more.
fn check_size(path: &Path, found: (u32, u32), expected: (u32, u32)) -> Result<(), FrameError> {
    if found == expected {
        return Ok(());
    }
    Err(file_fault(path, FileFault::Size { found: found.into(), expected: expected.into() }))
}

/// Appends `n_rows` rows, all of which the caller must write.
pub(crate) fn room<T: messages::Message>(loan: &mut Loan<T>, n_rows: usize) -> Result<&mut [T::Row], StepError> {
    Ok(loan.grow_unset(n_rows)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panic_of_the_decoder_is_a_fault_of_the_file() {
        let fault = guarded(|| -> Result<(), image::ImageError> { panic!("index 7 is out of bounds") });
        let error = file_fault(Path::new("camera/1/5.jpg"), fault.expect_err("panics")).to_string();
        assert_eq!(
            error,
            "camera/1/5.jpg: the image decoder cannot handle the damage of the file: index 7 is out of bounds"
        );
    }
}
