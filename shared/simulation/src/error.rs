//! Errors of simulating a drive.

use crate::limits::OutOfLimits;
use std::path::{Path, PathBuf};

/// Reason why a drive was not written.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// A setting is outside its range.
    #[error(transparent)]
    Setting(#[from] OutOfLimits),
    /// The output folder exists.
    #[error("{}: exists already; drives are never overwritten, choose another folder or remove it", .0.display())]
    Exists(PathBuf),
    /// A file could not be written.
    #[error("{}: cannot be written: {cause}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The error of the operating system.
        cause: std::io::Error,
    },
    /// An image could not be encoded.
    #[error("{}: JPEG encoding failed: {cause}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// The error of the encoder.
        cause: image::ImageError,
    },
    /// The manifest could not be written as TOML.
    #[error("drive.toml: cannot be written as TOML: {0}")]
    Manifest(#[from] toml::ser::Error),
}

impl SimulationError {
    /// Converts an I/O error on `path`, for `map_err`.
    pub(crate) fn write(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |cause| Self::Write { path, cause }
    }
}
