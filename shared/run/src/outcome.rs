//! How a run ended, and the exit code for it.

use crate::exit;
use serde::{Deserialize, Serialize};
use std::fmt;

/// How a run ended. `summary.json`, `report.json`, the control socket and the event `done` use these words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The whole drive was processed; live: the run ended on request or with the sensors.
    Done,
    /// Ended early on request: data in flight was processed, the rest of the drive was not read.
    Drained,
    /// Ended at once on request: data in flight is lost.
    Stopped,
    /// A fault ended the run.
    #[default]
    Failed,
}

impl Outcome {
    /// All outcomes.
    pub const ALL: [Self; 4] = [Self::Done, Self::Drained, Self::Stopped, Self::Failed];

    /// The word for the outcome.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Drained => "drained",
            Self::Stopped => "stopped",
            Self::Failed => "failed",
        }
    }

    /// Whether all data in flight was processed.
    pub const fn is_in_order(self) -> bool {
        match self {
            Self::Done | Self::Drained => true,
            Self::Stopped | Self::Failed => false,
        }
    }

    /// The exit code of the program that executed the run. `is_whole`: no data was lost and no stage doubts its
    /// results.
    pub const fn exit_code(self, is_whole: bool) -> u8 {
        match self {
            Self::Done if is_whole => exit::DONE,
            Self::Done | Self::Drained => exit::INCOMPLETE,
            Self::Stopped | Self::Failed => exit::FAILED,
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn word_in_files_is_the_word_on_screens() {
        for outcome in Outcome::ALL {
            assert_eq!(serde_json::to_value(outcome).expect("JSON"), outcome.word());
        }
    }

    #[test]
    fn exit_code_depends_on_losses_only_if_the_drive_was_processed() {
        let codes = |is_whole| Outcome::ALL.map(|outcome| outcome.exit_code(is_whole));
        assert_eq!(codes(true), [0, 3, 1, 1]);
        assert_eq!(codes(false), [3, 3, 1, 1]);
    }
}
