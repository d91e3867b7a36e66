//! Camera files into messages, decoded into the slots from which they are read.

use formats::drive::Frame;
use formats::manifest::{CameraEntry, MosaicEntry};
use formats::pgm::Pgm;
use image::{ColorType, DynamicImage, ImageDecoder, ImageReader};
use messages::{Image, ImageHeader, Mosaic, MosaicHeader};
use stage::{Loan, Outputs, StepError};
use std::path::Path;

/// Why a frame gives no message.
pub(crate) enum Fault {
    /// The file; it is left out.
    File(String),
    /// The pipeline; the run fails.
    Step(StepError),
}

impl From<StepError> for Fault {
    fn from(error: StepError) -> Self {
        Fault::Step(error)
    }
}

fn file_fault(path: &Path, rule: impl std::fmt::Display) -> Fault {
    Fault::File(format!("{}: {rule}", path.display()))
}

/// Publishes a color image.
pub(crate) fn publish_image(frame: &Frame, entry: &CameraEntry, outputs: &mut Outputs) -> Result<(), Fault> {
    let fault = |error: image::ImageError| file_fault(&frame.path, error);
    let io_fault = |error: std::io::Error| file_fault(&frame.path, error);
    let (width, height) = entry.model.size();
    let reader = ImageReader::open(&frame.path).map_err(io_fault)?.with_guessed_format().map_err(io_fault)?;
    let decoder = reader.into_decoder().map_err(fault)?;
    check_size(&frame.path, decoder.dimensions(), (width, height))?;
    let n_bytes = width as usize * height as usize * 3;
    let mut loan: Loan<Image> = outputs.loan(n_bytes)?;
    let pixels = room(&mut loan, n_bytes)?;
    // A decoder may leave the rows of a damaged file as they are.
    pixels.fill(0);
    if decoder.color_type() == ColorType::Rgb8 {
        decoder.read_image(pixels).map_err(fault)?;
    } else {
        pixels.copy_from_slice(DynamicImage::from_decoder(decoder).map_err(fault)?.to_rgb8().as_raw());
    }
    *loan.header_mut() =
        ImageHeader { camera: frame.camera as u32, width, height, channels: 3, exposure_nanos: entry.exposure_nanos };
    Ok(outputs.publish(loan, frame.stamp.0)?)
}

/// Publishes a raw mosaic.
pub(crate) fn publish_mosaic(frame: &Frame, entry: &MosaicEntry, outputs: &mut Outputs) -> Result<(), Fault> {
    let bytes = std::fs::read(&frame.path).map_err(|error| file_fault(&frame.path, error))?;
    let pgm = Pgm::parse(&bytes).map_err(|error| file_fault(&frame.path, error))?;
    let (width, height) = entry.model.size();
    check_size(&frame.path, (pgm.width, pgm.height), (width, height))?;
    let limit = (1_u32 << entry.bit_depth.min(16)) - 1;
    if pgm.max > limit {
        let rule = format!("samples up to {}, must be up to {limit} for a bit depth of {}", pgm.max, entry.bit_depth);
        return Err(file_fault(&frame.path, rule));
    }
    let mut loan: Loan<Mosaic> = outputs.loan(pgm.n_samples())?;
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

/// The camera's size is known from the manifest, so no header makes us take more memory than that.
fn check_size(path: &Path, got: (u32, u32), expected: (u32, u32)) -> Result<(), Fault> {
    if got == expected {
        return Ok(());
    }
    Err(file_fault(path, format!("{} x {} px, the camera has {} x {}", got.0, got.1, expected.0, expected.1)))
}

/// Rows for the caller to write, every one.
pub(crate) fn room<T: messages::Message>(loan: &mut Loan<T>, n_rows: usize) -> Result<&mut [T::Row], StepError> {
    let capacity = loan.capacity();
    loan.grow_unset(n_rows).ok_or_else(|| {
        StepError::Contract(format!("a slot of {} for {capacity} rows has no room for {n_rows}", T::TOPIC))
    })
}
