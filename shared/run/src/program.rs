//! Command line and exit codes that the programs of the project share.

use crate::{Change, Context, Remote};
use serde::{Deserialize, Serialize};
use settings::{Field, Problem};
use std::path::PathBuf;

/// Keys of a stage's table that the supervisor reads and the stage does not.
pub const SUPERVISOR_KEYS: [&str; 7] = ["host", "host_key", "program", "python", "remap", "stall_s", "threads"];

/// Environment variable that selects the log format of a stage: `json` writes one JSON object per line, any other value
/// writes lines for people.
pub const LOG_FORMAT: &str = "REPLICA_LOG_FORMAT";

/// Exit codes of all programs of the project.
pub mod exit {
    /// Success.
    pub const DONE: u8 = 0;
    /// Failed while running; a restart may help.
    pub const FAILED: u8 = 1;
    /// Invalid command line.
    pub const USAGE: u8 = 2;
    /// Finished, but incomplete or doubtful: data was lost or left out, or a threshold missed.
    pub const INCOMPLETE: u8 = 3;
    /// Invalid configuration; a restart cannot help.
    pub const CONFIGURATION: u8 = 78;
}

/// Argument of `--describe`; the answer is a [`Description`](crate::assignment::Description). The outputs of a stage may
/// depend on its settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DescribeRequest {
    /// The launch file.
    pub launch_file: PathBuf,
    /// Changes of the command line.
    pub changes: Vec<Change>,
    /// The stage's table.
    pub table: String,
    /// Host of the stage, if it is another host.
    #[serde(default)]
    pub remote: Option<Remote>,
}

/// Argument of `--check`; the answer is a list of [`Problem`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckRequest {
    /// The launch file.
    pub launch_file: PathBuf,
    /// Changes of the command line.
    pub changes: Vec<Change>,
    /// The stage's table.
    pub table: String,
    /// Context of the run.
    pub context: Context,
    /// Host of the stage, if it is another host.
    #[serde(default)]
    pub remote: Option<Remote>,
}

/// Argument of `replica simulate --describe`; the answer is a [`DriveDescription`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DescribeDriveRequest {
    /// The launch file.
    pub launch_file: PathBuf,
    /// Changes of the command line.
    pub changes: Vec<Change>,
    /// The drive of `[run]`, which need not exist.
    pub drive: PathBuf,
}

/// The table `[simulate]` of a launch file, as `replica simulate` interprets it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveDescription {
    /// All settings of the table.
    pub settings: Vec<Field>,
    /// Problems of the table, with their places.
    pub problems: Vec<Problem>,
    /// Differences between the drive and the table. Empty if the drive does not exist or was not simulated.
    pub differences: Vec<String>,
    /// Arguments of `replica` that simulate the drive, without the folder to create.
    pub arguments: Vec<String>,
}
