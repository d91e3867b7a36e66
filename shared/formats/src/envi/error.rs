//! Errors of ENVI files.

use std::path::PathBuf;

/// Error of an ENVI image that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("{path}{place}: {fault}", path = path.display(), place = line.map(|line| format!(":{line}")).unwrap_or_default())]
pub struct EnviError {
    /// The header or the data file.
    pub path: PathBuf,
    /// Line of the header, from 1, if the fault has one.
    pub line: Option<usize>,
    /// Fault of the image.
    pub fault: EnviFault,
}

/// Fault of an ENVI image.
#[derive(Debug, thiserror::Error)]
pub enum EnviFault {
    /// The operating system reported an error.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The first line of the header is not `ENVI`.
    #[error("{0:?} is not the first line of an ENVI header; expected `ENVI`")]
    Magic(String),
    /// A line of the header is not an entry.
    #[error("{0:?} is not an entry; expected `key = value`")]
    NotAnEntry(String),
    /// A list of the header has no closing brace.
    #[error("{0}: the list has no closing brace")]
    OpenList(String),
    /// The value of an entry is invalid.
    #[error("{key} = {value:?}: {rule}")]
    Value {
        /// Key of the entry.
        key: String,
        /// Value found.
        value: String,
        /// Values allowed.
        rule: ValueRule,
    },
    /// A required entry is missing.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// The wavelength unit is not supported.
    #[error("wavelength units = {0:?}: expected nanometers or micrometers")]
    WavelengthUnits(String),
    /// The header offset is past the end of the data file.
    #[error("{n_bytes} bytes: header offset = {offset} is beyond the end of the file")]
    Offset {
        /// Size of the data file.
        n_bytes: usize,
        /// Offset of the header.
        offset: usize,
    },
    /// The size of the image overflows.
    #[error("samples, lines and bands of the header are too large")]
    TooLarge,
    /// The data file is too short, or the image is empty.
    #[error(
        "{n_bytes} bytes of values: {samples} samples, {lines} lines and {bands} bands of {size} bytes need {expected}"
    )]
    DataSize {
        /// Bytes found.
        n_bytes: usize,
        /// Columns of the header.
        samples: usize,
        /// Rows of the header.
        lines: usize,
        /// Bands of the header.
        bands: usize,
        /// Bytes of a value.
        size: usize,
        /// Bytes expected.
        expected: usize,
    },
    /// An image to be written has a different number of values than its header requires.
    #[error("{found} values: the header needs {expected}")]
    ValueCount {
        /// Values of the image.
        found: usize,
        /// Values by the header.
        expected: usize,
    },
    /// A spectral library has more than one band.
    #[error("bands = {0}: a spectral library has 1 band")]
    LibraryBands(usize),
    /// A spectral library does not have one wavelength for each sample.
    #[error("{found} wavelengths: expected {expected}, one for each sample")]
    LibraryWavelengths {
        /// Wavelengths of the header.
        found: usize,
        /// Samples of the header.
        expected: usize,
    },
    /// A data file has no header.
    #[error("no .hdr file next to this file")]
    NoHeader,
    /// A header has no data file.
    #[error("no data file next to this header (.img, .dat, .bin, .sli, …)")]
    NoData,
}

/// Values that an entry of a header may have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ValueRule {
    /// An integer of at least this size.
    #[error("expected an integer from {0} to 2147483648")]
    Integer(usize),
    /// A number.
    #[error("expected a number")]
    Number,
    /// A list of numbers; one entry is not a number.
    #[error("{0:?} is not a number")]
    Numbers(String),
    /// One of these words.
    #[error("expected {0}")]
    OneOf(&'static str),
}
