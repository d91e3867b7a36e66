//! Images of any number of bands: ENVI cubes, and TIFFs with one sample per band as camera software writes them.

use crate::envi::{self, EnviError, EnviFault};
use crate::tiff::{Tiff, TiffError};
use files::regular_file;
use std::path::{Path, PathBuf};

/// An image, band-sequential.
#[derive(Clone, Debug, PartialEq)]
pub struct BandImage {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Number of bands.
    pub n_bands: usize,
    /// Center wavelength of each band, nm. Empty if the file has no wavelengths.
    pub wavelengths_nm: Vec<f32>,
    /// Rows of each plane. ENVI: divided by the reflectance scale factor; NaN where a value is to be ignored. TIFF:
    /// samples as stored.
    pub values: Vec<f32>,
}

/// Error of a file that is not an image.
#[derive(Debug, thiserror::Error)]
pub enum BandImageError {
    /// An ENVI file is invalid.
    #[error(transparent)]
    Envi(#[from] EnviError),
    /// The wavelengths of an ENVI file are invalid.
    #[error("{}: {fault}", .path.display())]
    Wavelengths {
        /// The file.
        path: PathBuf,
        /// Fault of the file.
        fault: EnviFault,
    },
    /// A TIFF is invalid.
    #[error("{}: {error}", .path.display())]
    Tiff {
        /// The file.
        path: PathBuf,
        /// Fault of the file.
        error: TiffError,
    },
    /// A file cannot be read.
    #[error("{}: {error}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        error: std::io::Error,
    },
}

fn is_tiff(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("tif") || ending.eq_ignore_ascii_case("tiff"))
}

/// Reads a TIFF if the extension names one, otherwise an ENVI image by the path of its header or of its data file.
pub fn read(path: &Path) -> Result<BandImage, BandImageError> {
    let path_buf = || path.to_owned();
    if is_tiff(path) {
        let bytes = regular_file::read(path).map_err(|error| BandImageError::Io { path: path_buf(), error })?;
        let image = Tiff::parse(&bytes).map_err(|error| BandImageError::Tiff { path: path_buf(), error })?;
        let n_bands = image.n_bands as usize;
        let plane = |band: usize| image.samples.iter().skip(band).step_by(n_bands).map(|sample| f32::from(*sample));
        return Ok(BandImage {
            size: [image.width as usize, image.height as usize],
            n_bands,
            wavelengths_nm: Vec::new(),
            values: (0..n_bands).flat_map(plane).collect(),
        });
    }
    let envi::Image { header, values } = envi::read(path)?;
    let wavelengths_nm =
        header.wavelengths_nm().map_err(|fault| BandImageError::Wavelengths { path: path_buf(), fault })?;
    let scale = header.reflectance_scale_factor.unwrap_or(1.0);
    let is_ignored = |value: f32| !value.is_finite() || Some(value) == header.data_ignore_value;
    Ok(BandImage {
        size: [header.samples, header.lines],
        n_bands: header.bands,
        wavelengths_nm,
        values: values.into_iter().map(|value| if is_ignored(value) { f32::NAN } else { value / scale }).collect(),
    })
}
