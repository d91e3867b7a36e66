//! Images of cameras.

use crate::accepted::accepted;
use formats::jpeg;
use formats::multipart::MultipartReader;
use formats::pgm::Pgm;
use formats::raw_mosaic::RawMosaic;
use formats::tiff::Tiff;
use image::{DynamicImage, ImageDecoder, ImageReader};
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Size of the images in the corpus, px. Like `acquire`, the target refuses other sizes before decoding.
const SIZE: (u32, u32) = (24, 16);

/// PNG and JPEG. Like `acquire`, the target survives a panic of the decoder.
pub(crate) fn color(bytes: &[u8]) {
    if jpeg::is_jpeg(bytes) {
        accepted(&jpeg::check(bytes));
    }
    let Ok(reader) = ImageReader::new(Cursor::new(bytes)).with_guessed_format() else { return };
    let Ok(decoder) = reader.into_decoder() else { return };
    if decoder.dimensions() == SIZE
        && let Ok(Ok(image)) = catch_unwind(AssertUnwindSafe(|| DynamicImage::from_decoder(decoder)))
    {
        assert_eq!(image.to_rgb8().as_raw().len(), (SIZE.0 * SIZE.1 * 3) as usize);
    }
}

/// A stream of images.
pub(crate) fn multipart(bytes: &[u8]) {
    let mut reader = MultipartReader::new(bytes);
    let mut image = Vec::new();
    while let Ok(Some(n_bytes)) = reader.next_header() {
        let read = reader.image(n_bytes, &mut image);
        accepted(&read);
        if read.is_err() {
            break;
        }
    }
}

pub(crate) fn pgm(bytes: &[u8]) {
    let parsed = Pgm::parse(bytes);
    accepted(&parsed);
    if let Ok(image) = parsed {
        let samples = image.samples();
        assert_eq!(samples.len(), image.n_samples());
    }
}

pub(crate) fn tiff(bytes: &[u8]) {
    let parsed = Tiff::parse(bytes);
    accepted(&parsed);
    if let Ok(image) = parsed {
        assert_eq!(
            image.samples.len() as u64,
            u64::from(image.width) * u64::from(image.height) * u64::from(image.n_bands)
        );
    }
}

pub(crate) fn raw_mosaic(bytes: &[u8]) {
    accepted(&RawMosaic::parse(bytes));
}
