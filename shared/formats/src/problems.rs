//! What can be wrong with a file that people write, such as `drive.toml`: all faults at once, each with its place.

use std::fmt;
use std::path::{Path, PathBuf};

/// One fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileProblem {
    /// The file it is about.
    pub file: PathBuf,
    /// Line in it, from 1, if the fault has one.
    pub line: Option<usize>,
    /// Key, as `camera[2].model.fx`; empty if it is about the whole file.
    pub key: String,
    /// What was found and what must be there.
    pub rule: String,
}

/// All faults of a file, or of a folder and the file that describes it; at least one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct FileError {
    /// In the order in which they were found.
    pub problems: Vec<FileProblem>,
}

impl FileProblem {
    /// A fault of a whole file.
    pub fn of_file(file: &Path, rule: impl Into<String>) -> Self {
        Self { file: file.to_owned(), line: None, key: String::new(), rule: rule.into() }
    }
}

impl fmt::Display for FileProblem {
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

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.problems.iter().enumerate() {
            let separator = if index == 0 { "" } else { "\n" };
            write!(f, "{separator}{problem}")?;
        }
        Ok(())
    }
}

impl From<FileProblem> for FileError {
    fn from(problem: FileProblem) -> Self {
        Self { problems: vec![problem] }
    }
}
