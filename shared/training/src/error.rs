//! Errors of training.

use segmentation::SegmentationError;
use std::path::PathBuf;

/// A training cannot start, continue or resume.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    /// The network or a file of weights cannot be used.
    #[error(transparent)]
    Segmentation(#[from] SegmentationError),
    /// A tensor operation failed.
    #[error("tensor operation: {0}")]
    Compute(#[from] candle_core::Error),
    /// No variable has this name.
    #[error("no variable `{name}`")]
    NoVariable {
        /// Name of the variable.
        name: String,
    },
    /// The filters of a tensor do not have zero mean, so they cannot be standardized filters.
    #[error("tensor `{name}`: the mean of a filter is not zero; such weights can run, but cannot be trained further")]
    NotStandardized {
        /// Name of the tensor.
        name: String,
    },
    /// The labels of an example do not fit the network.
    #[error("example {example} of the data: {reason}")]
    Example {
        /// Index in the data set.
        example: usize,
        /// Position, value and expected values.
        reason: String,
    },
    /// The file is not a checkpoint of this training.
    #[error("{}: {reason}", path.display())]
    Checkpoint {
        /// Path of the file.
        path: PathBuf,
        /// The difference and the action to take.
        reason: &'static str,
    },
}
