//! What can go wrong while a drive is made.

use std::path::{Path, PathBuf};

/// Why there is no drive.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// A setting outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// As given.
        value: String,
        /// What is allowed.
        rule: &'static str,
    },
    /// The drive's folder is there already.
    #[error("{}: exists already, a drive is never overwritten", .0.display())]
    Exists(PathBuf),
    /// A file could not be written.
    #[error("{}: {cause}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        cause: std::io::Error,
    },
    /// An image could not be coded.
    #[error("{}: {cause}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// The coder's reason.
        cause: image::ImageError,
    },
    /// The manifest could not be written as TOML.
    #[error("drive.toml: {0}")]
    Manifest(#[from] toml::ser::Error),
}

impl SimulationError {
    /// For `map_err` of file operations.
    pub(crate) fn write(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |cause| Self::Write { path, cause }
    }
}
