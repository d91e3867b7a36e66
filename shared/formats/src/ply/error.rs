//! Errors of reading and writing PLY files.

use std::io;
use std::path::{Path, PathBuf};

/// A PLY file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum PlyError {
    /// The operating system reported an error.
    #[error("{path}: cannot {action}: {cause}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was attempted.
        action: &'static str,
        /// Error of the operating system.
        #[source]
        cause: io::Error,
    },
    /// The header of a file is invalid.
    #[error("{path}: header line {line}: {rule}", path = path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What was found and what was expected.
        rule: String,
    },
    /// A header that common readers would not read is not written.
    #[error("{path}: header line {line}: {reason}", path = path.display())]
    UnwritableHeader {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// The rule that it violates.
        reason: UnwritableHeader,
    },
    /// The rows of a file are truncated or not numbers.
    #[error("{path}: byte {byte}: {rule}", path = path.display())]
    Payload {
        /// The file.
        path: PathBuf,
        /// Counted from 0.
        byte: usize,
        /// What was found and what was expected.
        rule: String,
    },
    /// A row to be written does not match the header.
    #[error("{path}: point {point}: {reason}", path = path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Counted from 0.
        point: usize,
        /// How it differs.
        reason: RowMismatch,
    },
    /// The coordinates of a point cannot be transformed.
    #[error("{path}: point {point}: {cause}", path = path.display())]
    Transform {
        /// The file.
        path: PathBuf,
        /// Counted from 0.
        point: usize,
        /// Why the transform failed.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A requested column does not exist or has another type.
    #[error("{path}: property {name}: {rule}", path = path.display())]
    Property {
        /// The file.
        path: PathBuf,
        /// Requested name.
        name: String,
        /// What the file contains.
        rule: String,
    },
}

/// A header line that common readers would not read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnwritableHeader {
    /// A comment is not one line of printable ASCII.
    #[error("text {0:?} must be one line of printable ASCII")]
    Text(String),
    /// A comment contains a keyword.
    #[error("text {text:?} must not contain {keyword:?}: some readers take it for the keyword")]
    Keyword {
        /// The comment.
        text: String,
        /// The keyword.
        keyword: &'static str,
    },
    /// The name of a property is not an identifier.
    #[error("name {0:?} must be letters, digits and underscores, not starting with a digit")]
    Name(String),
    /// Two properties have the same name.
    #[error("name {0:?} occurs twice")]
    DuplicateName(String),
    /// The type of a property is not supported by common readers.
    #[error("property {name} is of type {kind}; use float, double, uchar or int: some readers skip others")]
    Kind {
        /// The property.
        name: String,
        /// Its type.
        kind: &'static str,
    },
}

/// A row that does not match the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RowMismatch {
    /// A field has another type than its property.
    #[error("a field was given as {found}, its property is {expected}")]
    Kind {
        /// Type of the field.
        found: &'static str,
        /// Type of the property.
        expected: &'static str,
    },
    /// More fields than properties were given.
    #[error("a field of type {found} was given beyond the last property")]
    ExtraField {
        /// Type of the field.
        found: &'static str,
    },
    /// Fewer fields than properties were given.
    #[error("fields for the last {n_bytes} bytes are missing")]
    MissingFields {
        /// Bytes without a field.
        n_bytes: usize,
    },
    /// The number of rows differs from the header.
    #[error("the header declares {n_points} points")]
    Count {
        /// Rows that the header declares.
        n_points: usize,
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
