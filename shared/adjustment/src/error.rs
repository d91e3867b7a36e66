//! Errors of a survey.

use std::path::{Path, PathBuf};
use surveying::DeliverError;

/// Reason why drives cannot be adjusted as one survey.
#[derive(Debug, thiserror::Error)]
pub enum SurveyError {
    /// A file of a run cannot be read.
    #[error(transparent)]
    Run(#[from] DeliverError),
    /// A run or a table violates a rule.
    #[error("{}: {rule}", path.display())]
    Content {
        /// The run or the file.
        path: PathBuf,
        /// The value found, and the rule.
        rule: String,
    },
    /// The measurements leave a pose undetermined.
    #[error("the poses of the submaps are not determined by the measurements of the survey")]
    Undetermined,
}

impl SurveyError {
    /// A rule that the content of `path` violates.
    pub(crate) fn content(path: &Path, rule: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), rule: rule.into() }
    }
}
