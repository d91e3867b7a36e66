//! Reasons for refusing a swap before anything is checked.

use run::Change;

/// The reason for refusing a swap. Nothing was changed.
#[derive(Debug, thiserror::Error)]
pub enum SwapRefusal {
    /// The end of the run was requested.
    #[error("the run is draining")]
    Draining,
    /// Another swap is active.
    #[error("a swap of [{stage}] is in progress")]
    UnderWay {
        /// Table of the other stage.
        stage: String,
    },
    /// A sensor cannot wait for the swap.
    #[error("a live run cannot swap a stage: sensor data would be lost")]
    Live,
    /// A recording cannot take back ticks.
    #[error("the run is being recorded: the ticks of a swap that is undone could not be removed from the recording")]
    Recorded,
    /// The run has no stage of this name.
    #[error("[{stage}]: {hint}")]
    UnknownStage {
        /// The name.
        stage: String,
        /// The closest names.
        hint: String,
    },
    /// A change belongs to another table.
    #[error("{change}: a swap of [{stage}] changes only this table")]
    OtherTable {
        /// Table of the stage.
        stage: String,
        /// The change.
        change: Change,
    },
    /// The operating system cannot start a thread.
    #[error("the check cannot be started: {0}")]
    Thread(std::io::Error),
}
