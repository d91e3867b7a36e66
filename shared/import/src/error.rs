//! Errors of an import.

use formats::sqlite::SqliteError;
use std::error::Error;
use std::fmt;
use std::path::Path;

/// Error of a source that cannot be imported.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {rule}")]
pub struct ImportError {
    /// File or folder, with the line if there is one.
    pub place: String,
    /// The value found and the value expected.
    pub rule: Rule,
}

/// The value found and the value expected.
#[derive(Debug)]
pub enum Rule {
    /// Text of this crate.
    Text(String),
    /// Error of a reader or of the system.
    Fault(Box<dyn Error + Send + Sync>),
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Rule::Text(text) => f.write_str(text),
            Rule::Fault(fault) => fault.fmt(f),
        }
    }
}

impl ImportError {
    /// A problem of a file or folder.
    pub(crate) fn at(path: &Path, rule: impl Into<String>) -> Self {
        Self { place: path.display().to_string(), rule: Rule::Text(rule.into()) }
    }

    /// A problem of a part of a file.
    pub(crate) fn at_part(path: &Path, part: &str, rule: impl Into<String>) -> Self {
        Self { place: format!("{}: {part}", path.display()), rule: Rule::Text(rule.into()) }
    }

    /// A problem of a database.
    pub(crate) fn from_sqlite(error: SqliteError) -> Self {
        let SqliteError { path, page, fault } = error;
        Self { place: format!("{}: page {page}", path.display()), rule: Rule::Fault(Box::new(fault)) }
    }

    /// A problem of a line, from 1.
    pub(crate) fn at_line(path: &Path, line: usize, rule: impl Into<String>) -> Self {
        Self { place: format!("{}:{line}", path.display()), rule: Rule::Text(rule.into()) }
    }

    /// A problem of an option of the import.
    pub(crate) fn for_option(name: &str, rule: impl Into<String>) -> Self {
        Self { place: name.to_owned(), rule: Rule::Text(rule.into()) }
    }
}

/// Names the file of an error.
pub(crate) trait At<T> {
    /// The value, or the error with its file or folder.
    fn at(self, path: &Path) -> Result<T, ImportError>;
}

impl<T, E: Into<Box<dyn Error + Send + Sync>>> At<T> for Result<T, E> {
    fn at(self, path: &Path) -> Result<T, ImportError> {
        self.map_err(|fault| ImportError { place: path.display().to_string(), rule: Rule::Fault(fault.into()) })
    }
}
