//! Errors of writing a scene.

use formats::ply::PlyError;
use std::io;
use std::path::{Path, PathBuf};
use surveying::DeliverError;

/// Reason why a scene cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The run cannot be read.
    #[error(transparent)]
    Run(#[from] DeliverError),
    /// A cloud cannot be written.
    #[error(transparent)]
    Ply(#[from] PlyError),
    /// A file or a folder cannot be written.
    #[error("{}: cannot write: {source}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The run has not what a scene needs.
    #[error("{}: {rule}", path.display())]
    Unfit {
        /// The run.
        path: PathBuf,
        /// What it lacks, and what to do.
        rule: String,
    },
}

impl SceneError {
    pub(crate) fn file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::File { path: path.to_owned(), source }
    }
}
