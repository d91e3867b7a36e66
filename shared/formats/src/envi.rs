//! ENVI images and spectral libraries: a text header (`.hdr`) next to a data file of plain numbers.
//!
//! Read: all numeric types, interleaves and byte orders, with the variants that other programs write: comments, keys in any case,
//! lists over several lines, a missing `lines` (computed from the file size), any common extension of the data file.
//! Written: band-sequential, f32, little-endian, which `SPy`, GDAL and ENVI open.
//!
//! Not based on a crate: no maintained crate reads ENVI headers.

mod error;
mod header;
mod values;

pub use error::{EnviError, EnviFault, ValueRule};
pub use header::{DataType, Header, Interleave};

use files::regular_file;
use std::path::{Path, PathBuf};

/// An image with its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Metadata.
    pub header: Header,
    /// Band-sequential: `bands` planes of `lines` rows of `samples` values. Values are as stored, not divided by
    /// [`Header::reflectance_scale_factor`]. Integers above 2^24 are rounded.
    pub values: Vec<f32>,
}

/// A named reflectance spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct LibrarySpectrum {
    /// Name in the library.
    pub name: String,
    /// Wavelengths in the order of the library, nm.
    pub wavelengths_nm: Vec<f32>,
    /// Reflectance at each wavelength; 1 = perfect diffuser.
    pub reflectances: Vec<f32>,
}

/// Extensions of the data file of `name.hdr`.
const EXTENSIONS: [&str; 12] = ["", "img", "dat", "bin", "raw", "sli", "bsq", "bil", "bip", "cub", "IMG", "DAT"];

/// Reads an image by the path of its header or of its data file.
pub fn read(path: &Path) -> Result<Image, EnviError> {
    let (header_path, data_path) = pair(path)?;
    let text = regular_file::read(&header_path).map_err(error(&header_path))?;
    // Descriptions may be in any encoding; keys and numbers are ASCII.
    let mut header = Header::parse(&String::from_utf8_lossy(&text)).map_err(|(line, fault)| EnviError {
        path: header_path,
        line,
        fault,
    })?;
    let bytes = regular_file::read(&data_path).map_err(error(&data_path))?;
    let values = values::decode(&mut header, &bytes).map_err(error(&data_path))?;
    Ok(Image { header, values })
}

/// Writes the header `path` (ending in `.hdr`) and the data file next to it, `.img`: f32, band-sequential, little-endian,
/// offset 0, independent of the values of the header.
pub fn write(path: &Path, image: &Image) -> Result<(), EnviError> {
    let expected = image.header.samples * image.header.lines * image.header.bands;
    if image.values.len() != expected {
        return Err(error(path)(EnviFault::ValueCount { found: image.values.len(), expected }));
    }
    let data_path = path.with_extension("img");
    let bytes: Vec<u8> = image.values.iter().flat_map(|value| value.to_le_bytes()).collect();
    // The data file is written first: a header without data would look like an image.
    files::atomic_file::write_atomic(&data_path, &bytes).map_err(error(&data_path))?;
    files::atomic_file::write_atomic(path, image.header.text().as_bytes()).map_err(error(path))
}

/// An error that concerns a whole file.
fn error<E: Into<EnviFault>>(path: &Path) -> impl Fn(E) -> EnviError + '_ {
    |fault| EnviError { path: path.to_owned(), line: None, fault: fault.into() }
}

/// Reads a spectral library (`file type = ENVI Spectral Library`): one spectrum per line.
pub fn read_library(path: &Path) -> Result<Vec<LibrarySpectrum>, EnviError> {
    let Image { header, values } = read(path)?;
    let n = header.samples;
    if header.bands != 1 {
        return Err(error(path)(EnviFault::LibraryBands(header.bands)));
    }
    let wavelengths_nm = header.wavelengths_nm().map_err(error(path))?;
    if wavelengths_nm.len() != n {
        return Err(error(path)(EnviFault::LibraryWavelengths { found: wavelengths_nm.len(), expected: n }));
    }
    let scale = header.reflectance_scale_factor.unwrap_or_else(|| likely_scale(&values));
    let name = |i: usize| header.spectra_names.get(i).cloned().unwrap_or_else(|| format!("spectrum {i}"));
    let spectra = values.chunks_exact(n).enumerate().map(|(i, row)| LibrarySpectrum {
        name: name(i),
        wavelengths_nm: wavelengths_nm.clone(),
        reflectances: row.iter().map(|value| value / scale).collect(),
    });
    Ok(spectra.collect())
}

/// Libraries store fractions, per cent or ten thousandths, often without a scale factor. The scale is estimated from the
/// largest value.
fn likely_scale(values: &[f32]) -> f32 {
    let largest = values.iter().copied().filter(|value| value.is_finite()).fold(0.0, f32::max);
    match largest {
        // A specular glint may exceed a perfect diffuser, but not by a factor of two.
        largest if largest <= 2.0 => 1.0,
        largest if largest <= 200.0 => 100.0,
        _ => 10_000.0,
    }
}

/// Paths of the header and of the data file.
fn pair(path: &Path) -> Result<(PathBuf, PathBuf), EnviError> {
    let is_header = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("hdr"));
    if !is_header {
        let appended = PathBuf::from(format!("{}.hdr", path.display()));
        let header = [path.with_extension("hdr"), appended].into_iter().find(|header| header.is_file());
        return header.map(|header| (header, path.to_owned())).ok_or_else(|| error(path)(EnviFault::NoHeader));
    }
    let stem = path.with_extension("");
    let candidates = EXTENSIONS.iter().map(|extension| stem.with_extension(extension));
    // `name.img.hdr` is the header of `name.img`.
    let data = std::iter::once(stem.clone()).chain(candidates).find(|data| data.is_file());
    data.map(|data| (path.to_owned(), data)).ok_or_else(|| error(path)(EnviFault::NoData))
}
