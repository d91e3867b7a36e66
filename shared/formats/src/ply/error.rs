//! Errors of reading and writing PLY files.

use std::io;
use std::path::{Path, PathBuf};

/// Error of a PLY file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum PlyError {
    /// The operating system reported an error.
    #[error("{path}: cannot {action}: {cause}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The attempted operation.
        action: &'static str,
        /// Error of the operating system.
        #[source]
        cause: io::Error,
    },
    /// The header of a file is invalid.
    #[error("{path}: header line {line}: {fault}", path = path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// The value found and the value expected.
        fault: HeaderFault,
    },
    /// A header cannot be written, because common readers would reject it.
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
    #[error("{path}: byte {byte}: {fault}", path = path.display())]
    Payload {
        /// The file.
        path: PathBuf,
        /// Counted from 0.
        byte: usize,
        /// The value found and the value expected.
        fault: PayloadFault,
    },
    /// A row to be written does not match the header.
    #[error("{path}: point {point}: {reason}", path = path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Counted from 0.
        point: usize,
        /// The difference.
        reason: RowMismatch,
    },
    /// The coordinates of a point cannot be transformed.
    #[error("{path}: point {point}: {cause}", path = path.display())]
    Transform {
        /// The file.
        path: PathBuf,
        /// Counted from 0.
        point: usize,
        /// Error of the transform.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A requested column does not exist or has another type.
    #[error("{path}: property {name}: {fault}", path = path.display())]
    Property {
        /// The file.
        path: PathBuf,
        /// Requested name.
        name: String,
        /// The columns or values of the file.
        fault: PropertyFault,
    },
}

/// Fault of a header that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HeaderFault {
    /// The file is not a PLY file.
    #[error("not a PLY file: expected `ply`")]
    NoMagic,
    /// The header does not end.
    #[error("the header ends without `end_header`")]
    NoEnd,
    /// Lines end as on old Macintoshes.
    #[error("lines end with carriage returns only; convert them to line feeds: tr '\\r' '\\n'")]
    CarriageReturns,
    /// The file has no points.
    #[error("no element `vertex`")]
    NoVertex,
    /// Points have no columns.
    #[error("{n_points} vertices have no scalar property")]
    NoScalar {
        /// Points that the header declares.
        n_points: usize,
    },
    /// A name occurs twice.
    #[error("two properties or elements have the same name")]
    DuplicateName,
    /// The rows of the file cannot be changed in place.
    #[error("expected format binary_little_endian and vertices of scalars")]
    NotPlain,
    /// The parser refuses a line.
    #[error("{0}")]
    Parser(String),
}

/// Fault of a header line that common readers would not read.
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

/// Fault of a requested column.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PropertyFault {
    /// No property has the name.
    #[error("no such property; the file has {}", .known.join(" "))]
    Missing {
        /// The properties of the file.
        known: Vec<String>,
    },
    /// A value is not an integer.
    #[error("point {point} has {value}, not an integer")]
    NotInteger {
        /// Counted from 0.
        point: usize,
        /// The value found.
        value: f64,
    },
    /// A value does not fit into a byte.
    #[error("{0} is not within 0 to 255")]
    NotByte(i64),
}

/// Fault of rows that are truncated or not numbers.
#[derive(Debug, thiserror::Error)]
pub enum PayloadFault {
    /// The file is shorter than its header declares.
    #[error("the file ends before the {n_rows} rows of {element}, {row_size} bytes each")]
    Cut {
        /// Rows that the header declares.
        n_rows: usize,
        /// Name of the element.
        element: String,
        /// Bytes of a row.
        row_size: usize,
    },
    /// A row cannot be read.
    #[error("row {row} of {element}: {cause}")]
    Row {
        /// Counted from 0.
        row: usize,
        /// Name of the element.
        element: String,
        /// Error of the parser.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// Fault of a row that does not match the header.
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
    pub(super) fn header(path: &Path, line: usize, fault: HeaderFault) -> Self {
        PlyError::Header { path: path.to_owned(), line, fault }
    }
    pub(super) fn payload(path: &Path, byte: usize, fault: PayloadFault) -> Self {
        PlyError::Payload { path: path.to_owned(), byte, fault }
    }
}
