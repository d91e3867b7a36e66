//! Errors of supervision.

use crate::control::ControlError;
use crate::metrics::MetricsError;
use crate::programs::ProgramError;
use crate::recorder::RecorderError;
use crate::run_folder::RunFolderError;
use crate::stage_process::StartError;
use crate::swap::SwapError;
use ipc::IpcError;
use run::exit;
use run::summary::SummaryError;

/// The errors that end a run at once.
#[derive(Debug, thiserror::Error)]
pub enum SuperviseError {
    /// The run folder failed.
    #[error(transparent)]
    Folder(#[from] RunFolderError),
    /// Shared memory failed.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// A stage cannot be started.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The simulation of the drive failed.
    #[error(transparent)]
    Simulate(#[from] ProgramError),
    /// The recording failed.
    #[error(transparent)]
    Recorder(#[from] RecorderError),
    /// The metrics cannot be written.
    #[error(transparent)]
    Metrics(#[from] MetricsError),
    /// The socket of requests failed.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// A swap failed.
    #[error(transparent)]
    Swap(#[from] SwapError),
    /// Signals cannot be received.
    #[error("signals cannot be received: {0}")]
    Signals(std::io::Error),
    /// The summary cannot be written.
    #[error(transparent)]
    Summary(#[from] SummaryError),
    /// `--resume` was given in live mode.
    #[error("a live run cannot be resumed: the sensor data since it ended is lost; start a new run")]
    LiveResume,
    /// `--resume --record` was given.
    #[error("a recording must start with its run: leave out --record, or start a new run")]
    RecordingResume,
}

impl SuperviseError {
    /// The exit code of the supervisor: either the operator must change the command, or the start failed.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Folder(error) | Self::Swap(SwapError::Folder(error)) if error.is_of_configuration() => {
                exit::CONFIGURATION
            }
            _ => exit::FAILED,
        }
    }
}
