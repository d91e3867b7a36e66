//! What can be wrong with a PLY file.

use std::io;
use std::path::{Path, PathBuf};

/// Names file, place and rule.
#[derive(Debug, thiserror::Error)]
pub enum PlyError {
    /// The operating system refused.
    #[error("{path}: cannot {action}: {cause}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        #[source]
        cause: io::Error,
    },
    /// The header that was read, or that was to be written, breaks a rule.
    #[error("{path}: header line {line}: {rule}", path = path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What was found and what is allowed.
        rule: String,
    },
    /// The rows that were read are cut or no numbers.
    #[error("{path}: byte {byte}: {rule}", path = path.display())]
    Payload {
        /// The file.
        path: PathBuf,
        /// Counted from 0.
        byte: usize,
        /// What was found and what is allowed.
        rule: String,
    },
    /// The rows that were to be written do not fit the header.
    #[error("{path}: point {point}: {rule}", path = path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Counted from 0.
        point: usize,
        /// What was given and what the header says.
        rule: String,
    },
    /// A property that was asked for is not there, or is of another type.
    #[error("{path}: property {name}: {rule}", path = path.display())]
    Property {
        /// The file.
        path: PathBuf,
        /// What was asked for.
        name: String,
        /// What the file has.
        rule: String,
    },
}

impl PlyError {
    pub(super) fn io(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |cause| PlyError::Io { path: path.to_owned(), action, cause }
    }
    pub(super) fn header(path: &Path, line: usize, rule: impl Into<String>) -> Self {
        PlyError::Header { path: path.to_owned(), line, rule: rule.into() }
    }
    pub(super) fn payload(path: &Path, byte: usize, rule: impl Into<String>) -> Self {
        PlyError::Payload { path: path.to_owned(), byte, rule: rule.into() }
    }
}
