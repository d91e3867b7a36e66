//! ENVI images and spectral libraries: a text header (`.hdr`) beside a file of plain numbers.
//!
//! Read with all numeric types, interleaves and byte orders, and the habits of the programs that write them: comments, keys in any
//! case, lists over many lines, a missing `lines` (it follows from the file's size), a data file by any of the usual
//! endings. Written band-sequential, f32, little-endian: what `SPy`, GDAL and ENVI open without a question.

mod header;
mod values;

pub use header::{DataType, Header, Interleave};

use std::path::{Path, PathBuf};

/// Why files are no ENVI image.
#[derive(Debug, thiserror::Error)]
#[error("{path}{place}: {rule}", path = path.display(), place = line.map(|line| format!(":{line}")).unwrap_or_default())]
pub struct EnviError {
    /// The header or the data file.
    pub path: PathBuf,
    /// Line of the header, from 1.
    pub line: Option<usize>,
    /// What was found and what must be there.
    pub rule: String,
}

/// An image with its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// What the header says.
    pub header: Header,
    /// Band-sequential: `bands` planes of `lines` rows of `samples` values. As stored, not yet divided by
    /// [`Header::reflectance_scale_factor`]; integers above 2^24 are rounded.
    pub values: Vec<f32>,
}

/// A named reflectance spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct LibrarySpectrum {
    /// As the library calls it.
    pub name: String,
    /// Rising or not, as given, nm.
    pub wavelengths_nm: Vec<f32>,
    /// At each wavelength; 1 = perfect diffuser.
    pub reflectances: Vec<f32>,
}

/// Names that a data file may have beside `name.hdr`.
const ENDINGS: [&str; 12] = ["", "img", "dat", "bin", "raw", "sli", "bsq", "bil", "bip", "cub", "IMG", "DAT"];

/// Reads the image whose header is `path` (or whose data file it is, with the header beside it).
pub fn read(path: &Path) -> Result<Image, EnviError> {
    let (header_path, data_path) = pair(path)?;
    let error = |path: &Path, line, rule| EnviError { path: path.to_owned(), line, rule };
    let text = std::fs::read(&header_path).map_err(|cause| error(&header_path, None, cause.to_string()))?;
    // Descriptions may be in any encoding; keys and numbers are ASCII.
    let mut header = Header::parse(&String::from_utf8_lossy(&text))
        .map_err(|(line, rule)| error(&header_path, (line > 0).then_some(line), rule))?;
    let bytes = std::fs::read(&data_path).map_err(|cause| error(&data_path, None, cause.to_string()))?;
    let values = values::decode(&mut header, &bytes).map_err(|rule| error(&data_path, None, rule))?;
    Ok(Image { header, values })
}

/// Writes `path` (the header, ending in `.hdr`) and the data file beside it, `.img`. The header's data type, interleave,
/// byte order and offset are taken as f32, band-sequential, little-endian, 0.
pub fn write(path: &Path, image: &Image) -> Result<(), EnviError> {
    let error = |path: &Path, rule| EnviError { path: path.to_owned(), line: None, rule };
    let expected = image.header.samples * image.header.lines * image.header.bands;
    if image.values.len() != expected {
        return Err(error(path, format!("{} values; must be {expected} by the header", image.values.len())));
    }
    let data_path = path.with_extension("img");
    let bytes: Vec<u8> = image.values.iter().flat_map(|value| value.to_le_bytes()).collect();
    // The data first: a header without data would be taken for an image.
    crate::atomic_file::write_atomic(&data_path, &bytes).map_err(|cause| error(&data_path, cause.to_string()))?;
    crate::atomic_file::write_atomic(path, image.header.text().as_bytes())
        .map_err(|cause| error(path, cause.to_string()))
}

/// Reads a spectral library (`file type = ENVI Spectral Library`): one spectrum a line.
pub fn read_library(path: &Path) -> Result<Vec<LibrarySpectrum>, EnviError> {
    let Image { header, values } = read(path)?;
    let error = |rule: String| EnviError { path: path.to_owned(), line: None, rule };
    let n = header.samples;
    if header.bands != 1 {
        return Err(error(format!("bands = {}; a spectral library has 1", header.bands)));
    }
    let wavelengths_nm = header.wavelengths_nm().map_err(error)?;
    if wavelengths_nm.len() != n {
        return Err(error(format!("{} wavelengths; must be {n}, one for each sample", wavelengths_nm.len())));
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

/// Libraries store fractions, per cent or ten thousandths, and often do not say which: the largest value tells.
fn likely_scale(values: &[f32]) -> f32 {
    let largest = values.iter().copied().filter(|value| value.is_finite()).fold(0.0, f32::max);
    match largest {
        // A specular glint may exceed a perfect diffuser, but not twice.
        largest if largest <= 2.0 => 1.0,
        largest if largest <= 200.0 => 100.0,
        _ => 10_000.0,
    }
}

/// The header's and the data file's path.
fn pair(path: &Path) -> Result<(PathBuf, PathBuf), EnviError> {
    let error = |rule: &str| EnviError { path: path.to_owned(), line: None, rule: rule.to_owned() };
    let is_header = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("hdr"));
    if !is_header {
        let appended = PathBuf::from(format!("{}.hdr", path.display()));
        let header = [path.with_extension("hdr"), appended].into_iter().find(|header| header.is_file());
        return header.map(|header| (header, path.to_owned())).ok_or_else(|| error("has no .hdr file beside it"));
    }
    let stem = path.with_extension("");
    let candidates = ENDINGS.iter().map(|ending| stem.with_extension(ending));
    // `name.img.hdr` belongs to `name.img`: there the stem itself is the file.
    let data = std::iter::once(stem.clone()).chain(candidates).find(|data| data.is_file());
    data.map(|data| (path.to_owned(), data))
        .ok_or_else(|| error("has no data file beside it (.img, .dat, .bin, .sli, …)"))
}
