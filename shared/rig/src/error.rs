//! Errors.

use drive::Drive;
use files::problems::FileError;
use lidar::SweepError;
use std::io;
use std::path::{Path, PathBuf};

/// Reason why a rig cannot be made, checked or refined.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The drive folder has problems.
    #[error(transparent)]
    Drive(#[from] FileError),
    /// The captures cannot be read.
    #[error(transparent)]
    Sweeps(#[from] SweepError),
    /// The part of the drive has no complete sweep.
    #[error("{}: no sweep was found in this part of the drive; check the LiDAR's files, --start and --seconds", folder.display())]
    NoSweep {
        /// The drive.
        folder: PathBuf,
    },
    /// The operating system reported an error.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The error.
        source: io::Error,
    },
    /// A third-party file cannot be used.
    #[error("{}: {place}{rule}", path.display())]
    Source {
        /// The file or folder.
        path: PathBuf,
        /// Position in the file, with a colon at the end; empty for the whole file.
        place: String,
        /// The value found and the expected value.
        rule: String,
    },
    /// A text is not a rotation.
    #[error(transparent)]
    Rotation(#[from] crate::rotation::RotationError),
    /// A file exists and would be overwritten.
    #[error("{} exists already; --write replaces it", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
}

impl RigError {
    /// An error of the operating system about a path.
    pub fn io(path: &Path, source: io::Error) -> Self {
        Self::Io { path: path.to_owned(), source }
    }

    /// The error for a log of a drive that cannot be read.
    pub(crate) fn log(drive: &Drive, error: &io::Error) -> Self {
        Self::Io { path: drive.folder().to_owned(), source: io::Error::new(error.kind(), error.to_string()) }
    }

    /// The error for a third-party file that breaks a rule.
    pub fn source(path: &Path, place: &str, rule: impl Into<String>) -> Self {
        let place = if place.is_empty() { String::new() } else { format!("{place}: ") };
        Self::Source { path: path.to_owned(), place, rule: rule.into() }
    }
}
