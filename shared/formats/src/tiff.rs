//! Images of measurements as TIFF (TIFF 6.0): unsigned samples of 8 or 16 bits in strips, not compressed, one or many for each
//! pixel, side by side or plane after plane, either byte order. That is what programs of mosaic cameras write: raw mosaics of
//! one sample, and binned cubes of one sample for each band.

mod directory;

use directory::{Directory, Fields};

/// Why bytes are no such image.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("byte {offset}: {rule}")]
pub struct TiffError {
    /// Where.
    pub offset: usize,
    /// What was found and what must be there.
    pub rule: String,
}

/// No camera here has longer sides, px.
const MAX_SIDE: u32 = 32_768;
/// The largest cube has 16 x 16 bands.
const MAX_BANDS: u32 = 256;

/// The first image of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tiff {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples of a pixel.
    pub n_bands: u32,
    /// 8 or 16.
    pub bit_depth: u32,
    /// The exposure time that Exif tells, ns.
    pub exposure_nanos: Option<u64>,
    /// Row-major from the top left, the bands of a pixel side by side.
    pub samples: Vec<u16>,
}

mod tag {
    pub const WIDTH: u16 = 256;
    pub const HEIGHT: u16 = 257;
    pub const BITS: u16 = 258;
    pub const COMPRESSION: u16 = 259;
    pub const STRIP_OFFSETS: u16 = 273;
    pub const BANDS: u16 = 277;
    pub const STRIP_BYTES: u16 = 279;
    pub const PLANAR: u16 = 284;
    pub const SAMPLE_FORMAT: u16 = 339;
    pub const EXIF: u16 = 34_665;
    pub const EXPOSURE: u16 = 33_434;
}

impl Tiff {
    /// Reads the first image.
    pub fn parse(bytes: &[u8]) -> Result<Self, TiffError> {
        let (fields, directory) = Directory::first(bytes)?;
        let refuse = |tag: u16, rule: String| Err(TiffError { offset: directory.offset(tag), rule });
        let one = |tag: u16, limit: u32| {
            let value = directory.numbers(&fields, tag)?.first().copied();
            let value = value.filter(|value| (1..=limit).contains(value));
            value.ok_or_else(|| TiffError {
                offset: directory.offset(tag),
                rule: format!("tag {tag} must be there, with a value of 1 to {limit}"),
            })
        };
        let (width, height) = (one(tag::WIDTH, MAX_SIDE)?, one(tag::HEIGHT, MAX_SIDE)?);
        let n_bands = if directory.has(tag::BANDS) { one(tag::BANDS, MAX_BANDS)? } else { 1 };
        let bits = directory.numbers(&fields, tag::BITS)?;
        let bit_depth = match bits.first() {
            Some(depth @ (8 | 16)) if bits.iter().all(|bits| bits == depth) => *depth,
            _ => return refuse(tag::BITS, format!("{bits:?} bits a sample; must be 8 or 16, the same for all")),
        };
        let must_be_one = [(tag::COMPRESSION, "compression"), (tag::SAMPLE_FORMAT, "sample format")];
        for (tag, name) in must_be_one {
            let values = directory.numbers(&fields, tag)?;
            if values.iter().any(|value| *value != 1) {
                return refuse(tag, format!("{name} {values:?}; must be 1: whole numbers without compression"));
            }
        }
        let planes = match directory.numbers(&fields, tag::PLANAR)?.first() {
            None | Some(1) => false,
            Some(2) => true,
            Some(other) => return refuse(tag::PLANAR, format!("planar configuration {other}; must be 1 or 2")),
        };
        let n_samples = width as usize * height as usize * n_bands as usize;
        let data = strips(bytes, &fields, &directory, n_samples * bit_depth as usize / 8)?;
        let samples: Vec<u16> = match bit_depth {
            8 => data.into_iter().map(u16::from).collect(),
            _ => data.as_chunks().0.iter().map(|pair| fields.u16_of(*pair)).collect(),
        };
        let samples = if planes { side_by_side(&samples, n_bands as usize) } else { samples };
        let exposure_nanos = exposure_nanos(&fields, &directory);
        Ok(Self { width, height, n_bands, bit_depth, exposure_nanos, samples })
    }
}

/// All strips' bytes, one after the other.
fn strips(bytes: &[u8], fields: &Fields<'_>, directory: &Directory, n_bytes: usize) -> Result<Vec<u8>, TiffError> {
    let offsets = directory.numbers(fields, tag::STRIP_OFFSETS)?;
    let lengths = directory.numbers(fields, tag::STRIP_BYTES)?;
    let refuse = |offset: usize, rule: String| Err(TiffError { offset, rule });
    if offsets.len() != lengths.len() {
        let rule = format!("{} strip lengths for {} strips; must be one for each", lengths.len(), offsets.len());
        return refuse(directory.offset(tag::STRIP_BYTES), rule);
    }
    let mut data = Vec::new();
    for (offset, length) in offsets.into_iter().zip(lengths) {
        let (offset, length) = (offset as usize, length as usize);
        match bytes.get(offset..).and_then(|rest| rest.get(..length)) {
            // Strips may share bytes: what they say must not grow beyond the image.
            Some(strip) if data.len() + length <= n_bytes => data.extend_from_slice(strip),
            Some(_) => return refuse(offset, format!("the strips hold more than the image's {n_bytes} bytes")),
            None => return refuse(offset, format!("a strip of {length} bytes; the file has {}", bytes.len())),
        }
    }
    if data.len() != n_bytes {
        let rule = format!("the strips hold {} bytes; the image has {n_bytes}", data.len());
        return refuse(directory.offset(tag::STRIP_OFFSETS), rule);
    }
    Ok(data)
}

fn side_by_side(planes: &[u16], n_bands: usize) -> Vec<u16> {
    let n_pixels = planes.len() / n_bands;
    (0..n_pixels).flat_map(|pixel| (0..n_bands).map(move |band| planes[band * n_pixels + pixel])).collect()
}

/// Exif's exposure time, if the file has one that means something: up to 1000 s.
fn exposure_nanos(fields: &Fields<'_>, directory: &Directory) -> Option<u64> {
    let at = *directory.numbers(fields, tag::EXIF).ok()?.first()?;
    let exif = Directory::at(fields, at as usize).ok()?;
    let [numerator, denominator] = exif.rational(fields, tag::EXPOSURE)?;
    let nanos = (u64::from(numerator) * 1_000_000_000).checked_div(u64::from(denominator))?;
    (1..=1_000_000_000_000).contains(&nanos).then_some(nanos)
}
