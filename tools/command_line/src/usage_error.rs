//! Arguments that do not fit the run or the files that they name.

/// A wrong argument. The program ends with the exit code of wrong usage.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct UsageError(pub String);
