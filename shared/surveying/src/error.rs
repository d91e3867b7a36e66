//! Errors of writing a delivery.

use crate::crs::CrsError;
use formats::ply::PlyError;
use std::io;
use std::path::{Path, PathBuf};

/// Reason why files of a delivery cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum DeliverError {
    /// A file or a folder cannot be accessed.
    #[error("{}: cannot {action}: {source}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What failed, for example "write".
        action: &'static str,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The content of a file of the run violates a rule.
    #[error("{}: {rule}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The value found, and the rule.
        rule: String,
    },
    /// A cloud cannot be read or written.
    #[error(transparent)]
    Ply(#[from] PlyError),
    /// A point has no coordinates in the system of the delivery.
    #[error(transparent)]
    Crs(#[from] CrsError),
}

impl DeliverError {
    /// The error of a file system operation on `path`.
    pub(crate) fn file(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::File { path: path.to_owned(), action, source }
    }
    /// A rule that the content of `path` violates.
    pub(crate) fn content(path: &Path, rule: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), rule: rule.into() }
    }
}
