//! Errors of simulating a drive.

use crate::limits::OutOfLimits;
use std::path::{Path, PathBuf};

/// Why a drive was not written.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// A setting outside its range.
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
        /// The system's reason.
        cause: std::io::Error,
    },
    /// An image could not be encoded.
    #[error("{}: JPEG encoding failed: {cause}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// The encoder's reason.
        cause: image::ImageError,
    },
    /// The manifest could not be written as TOML.
    #[error("drive.toml: cannot be written as TOML: {0}")]
    Manifest(#[from] toml::ser::Error),
}

impl SimulationError {
    /// For `map_err` of file operations.
    pub(crate) fn write(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |cause| Self::Write { path, cause }
    }
}
