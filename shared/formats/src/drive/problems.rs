//! What can be wrong with a drive folder.

use std::fmt;
use std::path::{Path, PathBuf};

/// One fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DriveProblem {
    /// The file it is about.
    pub file: PathBuf,
    /// Line in it, from 1, if the fault has one.
    pub line: Option<usize>,
    /// Key, as `camera[2].model.fx`; empty if it is about the whole file.
    pub key: String,
    /// What was found and what must be there.
    pub rule: String,
}

/// All faults of a drive folder, at least one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct DriveError {
    /// In the order of the manifest.
    pub problems: Vec<DriveProblem>,
}

impl DriveProblem {
    pub(crate) fn of_file(file: &Path, rule: impl Into<String>) -> Self {
        Self { file: file.to_owned(), line: None, key: String::new(), rule: rule.into() }
    }
}

impl fmt::Display for DriveProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        write!(f, ": {}", self.rule)
    }
}

impl fmt::Display for DriveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.problems.iter().enumerate() {
            let separator = if index == 0 { "" } else { "\n" };
            write!(f, "{separator}{problem}")?;
        }
        Ok(())
    }
}

impl From<DriveProblem> for DriveError {
    fn from(problem: DriveProblem) -> Self {
        Self { problems: vec![problem] }
    }
}
