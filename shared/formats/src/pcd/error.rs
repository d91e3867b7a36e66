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
    #[error("DATA {0:?} is not supported; expected ascii, binary or binary_compressed")]
    Encoding(String),
    /// Neither `POINTS` nor `WIDTH` and `HEIGHT` are given.
    #[error("neither POINTS nor WIDTH and HEIGHT are given before DATA")]
    NoCount,
    /// The header contradicts itself.
    #[error("POINTS {n_points}, but WIDTH {width} times HEIGHT {height}: the header contradicts itself")]
    Size {
        /// Value of `POINTS`.
        n_points: usize,
        /// Value of `WIDTH`.
        width: usize,
        /// Value of `HEIGHT`.
        height: usize,
    },
    /// A field occurs twice.
    #[error("field {0} occurs twice")]
    Twice(String),
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
    /// Padding has no bytes.
    #[error(
        "COUNT 0 of padding `_` before field {before:?}: files with such headers have bytes there, so the places of the fields \
         are unknown; convert the original recording again"
    )]
    EmptyPadding {
        /// The field after it; empty for the last one.
        before: String,
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
    /// Binary data is longer than the header requires.
    #[error(
        "{n_points} points of {row_bytes} bytes are declared, {found} bytes follow: the header contradicts the data"
    )]
    BinaryLonger {
        /// Points of the header.
        n_points: usize,
        /// Bytes of a row.
        row_bytes: usize,
        /// Bytes found.
        found: usize,
    },
    /// The size of compressed data contradicts the header.
    #[error("{n_points} points of {row_bytes} bytes are declared; the compressed data holds {found} bytes")]
    CompressedLength {
        /// Points of the header.
        n_points: usize,
        /// Bytes of a row.
        row_bytes: usize,
        /// Bytes stated before the compressed data.
        found: usize,
    },
    /// Compressed data is cut.
    #[error("{declared} bytes of compressed data are declared, {found} follow")]
    CompressedTruncated {
        /// Bytes declared.
        declared: usize,
        /// Bytes found.
        found: usize,
    },
    /// Few bytes hold many points.
    #[error("{n_points} points in {n_bytes} bytes of compressed data: no cloud is so small; the file is damaged")]
    TooCompressed {
        /// Points of the header.
        n_points: usize,
        /// Bytes of the compressed data.
        n_bytes: usize,
    },
    /// Compressed data is damaged.
    #[error(transparent)]
    Lzf(#[from] super::LzfFault),
    /// ASCII data has more points than the header.
    #[error("{n_points} points are declared, more follow")]
    AsciiLonger {
        /// Points of the header.
        n_points: usize,
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
    /// A value is not a number.
    #[error("{0:?} is not a number")]
    Number(String),
}
