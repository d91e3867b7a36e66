//! Errors of PCD files.

/// Error of a PCD file that cannot be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct PcdError {
    /// Line, from 1. For binary data, the last line of the header.
    pub line: usize,
    /// Fault of the file.
    pub fault: PcdFault,
}

/// Fault of a PCD file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PcdFault {
    /// A line is not UTF-8.
    #[error("the line is not text")]
    NotText,
    /// The file ends inside the header.
    #[error("the file ends inside the header")]
    HeaderTruncated,
    /// The header has no `DATA` line.
    #[error("no DATA line up to here")]
    NoData,
    /// A number of points is not an integer.
    #[error("{keyword} {found:?} is not a number of points")]
    Count {
        /// Keyword of the line.
        keyword: String,
        /// Text found.
        found: String,
    },
    /// An entry of `SIZE` or `COUNT` is not a small integer.
    #[error("{found:?} is not an integer up to {limit}")]
    Integer {
        /// Text found.
        found: String,
        /// Largest value.
        limit: usize,
    },
    /// The encoding is not supported.
    #[error("DATA {0:?} is not supported; expected ascii or binary")]
    Encoding(String),
    /// Neither `POINTS` nor `WIDTH` and `HEIGHT` are given.
    #[error("neither POINTS nor WIDTH and HEIGHT are given before DATA")]
    NoCount,
    /// The lists of the header differ in length.
    #[error("{fields} FIELDS, {sizes} SIZE, {types} TYPE, {counts} COUNT; expected equal numbers")]
    Lists {
        /// Entries of `FIELDS`.
        fields: usize,
        /// Entries of `SIZE`.
        sizes: usize,
        /// Entries of `TYPE`.
        types: usize,
        /// Entries of `COUNT`.
        counts: usize,
    },
    /// The type of a field is unknown.
    #[error("field {field}: type {kind} of {size} bytes is unknown; expected F4 F8 I1 I2 I4 I8 U1 U2 U4 or U8")]
    Type {
        /// The field.
        field: String,
        /// Its `TYPE`.
        kind: String,
        /// Its `SIZE`.
        size: usize,
    },
    /// A row has too many values.
    #[error("{found} values per row; at most {limit} are supported")]
    RowLength {
        /// Values of a row.
        found: usize,
        /// Most values.
        limit: usize,
    },
    /// A coordinate is missing.
    #[error("no field {0}")]
    MissingField(&'static str),
    /// Binary data is shorter than the header requires.
    #[error("{n_points} points of {row_bytes} bytes are declared, {found} bytes follow")]
    BinaryTruncated {
        /// Points of the header.
        n_points: usize,
        /// Bytes of a row.
        row_bytes: usize,
        /// Bytes found.
        found: usize,
    },
    /// ASCII data has fewer points than the header.
    #[error("{n_points} points are declared, {found} follow")]
    AsciiTruncated {
        /// Points of the header.
        n_points: usize,
        /// Points found.
        found: usize,
    },
    /// A row has too few values.
    #[error("{found} values, expected {expected}")]
    TooFewValues {
        /// Values of the row.
        found: usize,
        /// Values by the header.
        expected: usize,
    },
    /// A ring is not a beam number.
    #[error("point {index}: ring {found} must be a whole number from 0 to 255")]
    Ring {
        /// Index of the point.
        index: usize,
        /// The value found.
        found: f64,
    },
    /// A time is before the sweep's stamp or too late.
    #[error("point {index}: {field} {found} must be a time after the sweep's stamp, 0 to 4 s ({unit})")]
    Time {
        /// Index of the point.
        index: usize,
        /// `t` or `time`.
        field: &'static str,
        /// The value found.
        found: f64,
        /// Unit of the field.
        unit: &'static str,
    },
    /// A value is not a number.
    #[error("{0:?} is not a number")]
    Number(String),
}
