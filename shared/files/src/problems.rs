//! Problems of hand-written files such as `drive.toml`. All problems are reported at once, each with its position.

use std::fmt;
use std::path::{Path, PathBuf};

/// One problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileProblem {
    /// The file.
    pub file: PathBuf,
    /// Line, from 1, if the problem has one.
    pub line: Option<usize>,
    /// Key, for example `camera[2].model.fx`; empty for problems of the whole file.
    pub key: String,
    /// The value found and the value expected.
    pub rule: String,
}

/// All problems of a file, or of a folder and the file that describes it. At least one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct FileError {
    /// Problems in the order in which they were found.
    pub problems: Vec<FileProblem>,
}

impl FileProblem {
    /// A problem of a whole file.
    pub fn for_file(file: &Path, rule: impl Into<String>) -> Self {
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
