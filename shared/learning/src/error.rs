//! What can be wrong with a model or with what it is asked to label.

use std::path::PathBuf;

/// Every text names the file, the place in it, the value and the rule.
#[derive(Debug, thiserror::Error)]
pub enum LearningError {
    /// The file cannot be read or written.
    #[error("{}: {cause}", path.display())]
    Io {
        /// Of the model.
        path: PathBuf,
        /// What the operating system said.
        cause: std::io::Error,
    },
    /// Longer than any model of this project.
    #[error("{}: {got} bytes, a model has at most {limit}", path.display())]
    TooLarge {
        /// Of the model.
        path: PathBuf,
        /// Its length.
        got: u64,
        /// The longest allowed.
        limit: u64,
    },
    /// No safetensors file, or one that is cut off.
    #[error("{}: not a whole safetensors file: {reason}", path.display())]
    Container {
        /// Of the model.
        path: PathBuf,
        /// What the reader of the format said.
        reason: String,
    },
    /// A safetensors file that does not say what model it is.
    #[error("{}: metadata key `model`: {reason}", path.display())]
    Card {
        /// Of the model.
        path: PathBuf,
        /// What is missing or wrong.
        reason: String,
    },
    /// A kind of model that this program cannot run.
    #[error("{}: architecture `{got}` is not known; known are {known}", path.display())]
    Architecture {
        /// Of the model.
        path: PathBuf,
        /// In the file.
        got: String,
        /// The known ones.
        known: &'static str,
    },
    /// A known kind of model in another version.
    #[error("{}: {architecture} has version {got}, this program runs {expected}", path.display())]
    Version {
        /// Of the model.
        path: PathBuf,
        /// Kind of model.
        architecture: String,
        /// In the file.
        got: u32,
        /// Of this program.
        expected: u32,
    },
    /// A setting in the file breaks its rule.
    #[error("{}: settings.{key} = {value} {rule}", path.display())]
    Setting {
        /// Of the model.
        path: PathBuf,
        /// Which setting.
        key: &'static str,
        /// In the file.
        value: f64,
        /// What is allowed.
        rule: String,
    },
    /// A tensor is absent or not as the architecture needs it.
    #[error("{}: tensor `{name}`: {reason}", path.display())]
    Tensor {
        /// Of the model.
        path: PathBuf,
        /// Which tensor.
        name: String,
        /// What is wrong, and the rule.
        reason: String,
    },
    /// Columns of a submap that differ in length.
    #[error("{what} has {got} rows for {expected} points")]
    Length {
        /// Which column.
        what: &'static str,
        /// Its rows.
        got: usize,
        /// Points of the submap.
        expected: usize,
    },
    /// An example of a data set does not fit the network that it is for.
    #[error("example {example} of the data: {reason}")]
    Example {
        /// Its place in the data set.
        example: usize,
        /// Where, what is wrong, and the rule.
        reason: String,
    },
    /// A tensor operation failed.
    #[error("tensor operation: {0}")]
    Compute(#[from] candle_core::Error),
}
