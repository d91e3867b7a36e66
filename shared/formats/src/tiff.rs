//! Measurement images as TIFF: unsigned samples of 8 or 16 bits, uncompressed, one or many per pixel, interleaved or in planes, in
//! either byte order. Programs of mosaic cameras write raw mosaics (one sample per pixel) and binned cubes (one sample per band).
//!
//! The crate tiff decodes the files. Compressed images and other sample types are refused: they are pictures, not measurements.

mod directory;

use ndarray::ArrayView2;
use std::fmt::Display;
use std::io::Cursor;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::{CompressionMethod, IfdPointer, PhotometricInterpretation, PlanarConfiguration, SampleFormat, Tag};

/// Error of a file that is not a supported image.
#[derive(Debug, thiserror::Error)]
pub enum TiffError {
    /// The file is damaged.
    #[error("TIFF: {0}")]
    Decode(#[from] tiff::TiffError),
    /// A tag has an unsupported value.
    #[error("TIFF tag {tag:?} is {found}; expected {expected}")]
    Tag {
        /// The tag.
        tag: Tag,
        /// Its value.
        found: String,
        /// Supported values.
        expected: String,
    },
    /// A value is longer than the file.
    #[error("TIFF tag {tag} has {found} bytes; the file has {n_bytes}")]
    Value {
        /// The tag.
        tag: u16,
        /// Bytes of its value.
        found: u64,
        /// Bytes of the file.
        n_bytes: usize,
    },
    /// The strips have another size than the image, or more bytes than the file.
    #[error(
        "TIFF strips hold {found} bytes, the image of {width} x {height} pixels needs {expected}; the file has {n_bytes} bytes"
    )]
    Strips {
        /// Bytes of the strips.
        found: u64,
        /// Bytes of the file.
        n_bytes: usize,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes of the image.
        expected: u64,
    },
}

/// Longest side of an image, px. No supported camera has longer sides.
const MAX_SIDE: u32 = 32_768;
/// Most samples per pixel: a pattern of 16 x 16 bands.
const MAX_BANDS: u32 = 256;
/// Longest plausible exposure time: 1000 s.
const MAX_EXPOSURE_NANOS: u64 = 1_000_000_000_000;

/// The first image of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tiff {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples per pixel.
    pub n_bands: u32,
    /// 8 or 16.
    pub bit_depth: u32,
    /// Exposure time of the Exif directory, ns.
    pub exposure_nanos: Option<u64>,
    /// Row-major from the top left, the bands of a pixel interleaved.
    pub samples: Vec<u16>,
}

impl Tiff {
    /// Reads the first image.
    pub fn parse(bytes: &[u8]) -> Result<Self, TiffError> {
        directory::check(bytes)?;
        let mut limits = Limits::default();
        // A decoded image is as large as its strips.
        limits.decoding_buffer_size = bytes.len();
        limits.intermediate_buffer_size = bytes.len();
        limits.ifd_value_size = bytes.len();
        let mut decoder = Decoder::new(Cursor::new(bytes))?.with_limits(limits);
        let layout = Layout::read(&mut decoder, bytes.len())?;
        let Layout { width, height, n_bands, bit_depth, .. } = layout;
        let mut decoded = DecodingResult::U8(Vec::new());
        decoder.read_image_to_buffer(&mut decoded)?;
        let mut samples: Vec<u16> = match decoded {
            DecodingResult::U8(samples) => samples.into_iter().map(u16::from).collect(),
            DecodingResult::U16(samples) => samples,
            _ => return Err(refuse(Tag::SampleFormat, &"not unsigned", "unsigned integers")),
        };
        if layout.is_inverted {
            // The decoder inverts such images; this crate returns the values as stored.
            let max = u16::MAX >> (16 - bit_depth);
            for sample in &mut samples {
                *sample = max - *sample;
            }
        }
        if layout.is_planar {
            samples = interleaved(&samples, n_bands as usize);
        }
        let exposure_nanos = exposure_nanos(&mut decoder);
        Ok(Self { width, height, n_bands, bit_depth, exposure_nanos, samples })
    }
}

/// Checked properties of an image.
struct Layout {
    width: u32,
    height: u32,
    n_bands: u32,
    bit_depth: u32,
    is_planar: bool,
    is_inverted: bool,
}

impl Layout {
    /// Checks the tags of an image. `n_bytes`: size of the file.
    fn read(decoder: &mut Decoder<Cursor<&[u8]>>, n_bytes: usize) -> Result<Self, TiffError> {
        let mut number = |tag: Tag, default: u32, allowed: std::ops::RangeInclusive<u32>| {
            let found = decoder.find_tag_unsigned(tag)?.unwrap_or(default);
            if allowed.contains(&found) {
                return Ok(found);
            }
            Err(refuse(tag, &found, format!("{} to {}", allowed.start(), allowed.end())))
        };
        let width = number(Tag::ImageWidth, 0, 1..=MAX_SIDE)?;
        let height = number(Tag::ImageLength, 0, 1..=MAX_SIDE)?;
        let n_bands = number(Tag::SamplesPerPixel, 1, 1..=MAX_BANDS)?;
        let bits: Vec<u32> = decoder.find_tag_unsigned_vec(Tag::BitsPerSample)?.unwrap_or_default();
        let bit_depth = match bits.first() {
            Some(depth @ (8 | 16)) if bits.iter().all(|bits| bits == depth) => *depth,
            _ => return Err(refuse(Tag::BitsPerSample, &format!("{bits:?}"), "8 or 16, equal for all samples")),
        };
        let compression = decoder.find_tag_unsigned(Tag::Compression)?.unwrap_or(1_u16);
        if compression != CompressionMethod::None.to_u16() {
            return Err(refuse(Tag::Compression, &compression, "1: uncompressed"));
        }
        let formats: Vec<u16> = decoder.find_tag_unsigned_vec(Tag::SampleFormat)?.unwrap_or_default();
        if formats.iter().any(|format| *format != SampleFormat::Uint.to_u16()) {
            return Err(refuse(Tag::SampleFormat, &format!("{formats:?}"), "1: unsigned integers"));
        }
        let strips: Vec<u64> = decoder.find_tag_unsigned_vec(Tag::StripByteCounts)?.unwrap_or_default();
        let found = strips.iter().fold(0, |sum: u64, n_bytes| sum.saturating_add(*n_bytes));
        let expected = u64::from(width) * u64::from(height) * u64::from(n_bands) * u64::from(bit_depth / 8);
        // Overlapping strips would make a small file a large image.
        if found != expected || expected > n_bytes as u64 {
            return Err(TiffError::Strips { found, n_bytes, width, height, expected });
        }
        let photometric: Option<u16> = decoder.find_tag_unsigned(Tag::PhotometricInterpretation)?;
        let planar: Option<u16> = decoder.find_tag_unsigned(Tag::PlanarConfiguration)?;
        let is_inverted = photometric == Some(PhotometricInterpretation::WhiteIsZero.to_u16());
        let is_planar = n_bands > 1 && planar == Some(PlanarConfiguration::Planar.to_u16());
        Ok(Self { width, height, n_bands, bit_depth, is_planar, is_inverted })
    }
}

fn refuse(tag: Tag, found: &dyn Display, expected: impl Into<String>) -> TiffError {
    TiffError::Tag { tag, found: found.to_string(), expected: expected.into() }
}

/// Converts planes to interleaved bands.
fn interleaved(planes: &[u16], n_bands: usize) -> Vec<u16> {
    let n_pixels = planes.len() / n_bands;
    let planes = ArrayView2::from_shape((n_bands, n_pixels), planes).expect("one plane for each band");
    let mut samples = Vec::with_capacity(planes.len());
    // `iter` keeps the order of the axes; `for_each` visits the samples in the order of memory.
    samples.extend(planes.t().iter());
    samples
}

/// Exposure time of the Exif directory, if present and plausible.
fn exposure_nanos(decoder: &mut Decoder<Cursor<&[u8]>>) -> Option<u64> {
    let pointer: u64 = decoder.find_tag_unsigned(Tag::ExifDirectory).ok()??;
    let exif = decoder.read_directory(IfdPointer(pointer)).ok()?;
    let fraction = decoder.read_directory_tags(&exif).find_tag(Tag::from_u16_exhaustive(EXPOSURE_TIME)).ok()??;
    let tiff::decoder::ifd::Value::Rational(numerator, denominator) = fraction else { return None };
    let nanos = (u64::from(numerator) * 1_000_000_000).checked_div(u64::from(denominator))?;
    (1..=MAX_EXPOSURE_NANOS).contains(&nanos).then_some(nanos)
}

/// Exif tag `ExposureTime`.
const EXPOSURE_TIME: u16 = 33_434;
