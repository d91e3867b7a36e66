//! Errors that stop a stage.

use crate::exit;
use run::StateError;
use run::state_file::StateFileError;
use std::error::Error;
use std::fmt::Display;

/// The cause of an error.
type Source = Box<dyn Error + Send + Sync>;

/// An error that stops a stage. The text names the file or message, the place, the value and the rule.
#[derive(Debug, thiserror::Error)]
pub enum StepError {
    /// The stage cannot work with its input. See [`StepError::data`].
    #[error(transparent)]
    Data(Source),
    /// A file or the operating system failed. See [`StepError::io`].
    #[error(transparent)]
    Io(Source),
    /// The run is being stopped; not a failure of the stage.
    #[error("stopped while waiting to publish on {topic}")]
    Stopped {
        /// The topic whose consumers had no room.
        topic: String,
    },
    /// Shared memory failed.
    #[error(transparent)]
    Ipc(#[from] ipc::IpcError),
    /// The settings require data that this drive does not have; a restart cannot help. See
    /// [`StepError::configuration`].
    #[error(transparent)]
    Configuration(Source),
    /// The stage broke the contract, e.g. published a column for the wrong submap. See [`StepError::contract`].
    #[error(transparent)]
    Contract(Source),
}

/// An error and where it happened.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {source}")]
struct At {
    place: String,
    source: Source,
}

impl StepError {
    /// Input that the stage cannot work with: an error or a text.
    pub fn data(cause: impl Into<Source>) -> Self {
        Self::Data(cause.into())
    }
    /// A failure of a file or the operating system: an error or a text.
    pub fn io(cause: impl Into<Source>) -> Self {
        Self::Io(cause.into())
    }
    /// Settings that this drive cannot fulfil: an error or a text. The process ends with exit code 78 and is not
    /// restarted.
    pub fn configuration(cause: impl Into<Source>) -> Self {
        Self::Configuration(cause.into())
    }
    /// A broken contract: an error or a text.
    pub fn contract(cause: impl Into<Source>) -> Self {
        Self::Contract(cause.into())
    }
    /// Exit code of a process that ends with this error.
    pub(crate) fn exit_code(&self) -> u8 {
        if let Self::Configuration(_) = self { exit::CONFIGURATION } else { exit::FAILED }
    }
    /// Prepends the file, message or field in which the error happened to its text.
    #[must_use]
    pub fn at(self, place: impl Display) -> Self {
        let place = place.to_string();
        match self {
            Self::Data(source) => Self::data(At { place, source }),
            Self::Io(source) => Self::io(At { place, source }),
            Self::Contract(source) => Self::contract(At { place, source }),
            Self::Configuration(source) => Self::configuration(At { place, source }),
            other @ (Self::Stopped { .. } | Self::Ipc(_)) => other,
        }
    }
}

impl From<StateError> for StepError {
    fn from(error: StateError) -> Self {
        Self::data(error)
    }
}

impl From<StateFileError> for StepError {
    fn from(error: StateFileError) -> Self {
        Self::io(error)
    }
}

impl From<ipc::SavedMessageError> for StepError {
    fn from(error: ipc::SavedMessageError) -> Self {
        Self::data(error)
    }
}

impl From<ipc::LoanFull> for StepError {
    fn from(error: ipc::LoanFull) -> Self {
        Self::contract(error)
    }
}

impl From<messages::SubmapError> for StepError {
    fn from(error: messages::SubmapError) -> Self {
        Self::data(error)
    }
}

impl From<messages::NotFinite> for StepError {
    fn from(error: messages::NotFinite) -> Self {
        Self::contract(error)
    }
}

impl From<messages::PoseError> for StepError {
    fn from(error: messages::PoseError) -> Self {
        Self::data(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_with_place_shows_it_and_keeps_its_source() {
        let cause = std::io::Error::from(std::io::ErrorKind::PermissionDenied);
        let error = StepError::io(cause).at("clouds/index.json");
        assert_eq!(error.to_string(), "clouds/index.json: permission denied");
        let source = error.source().and_then(|source| source.downcast_ref::<std::io::Error>());
        assert!(source.is_some_and(|source| source.kind() == std::io::ErrorKind::PermissionDenied));
        assert_eq!(StepError::data("no sweeps").at("a.pcap").to_string(), "a.pcap: no sweeps");
    }

    #[test]
    fn only_configuration_errors_end_a_process_for_good() {
        assert_eq!(StepError::configuration("frame = \"utm\"").at("export").exit_code(), exit::CONFIGURATION);
        assert_eq!(StepError::data("no sweeps").exit_code(), exit::FAILED);
    }
}
