//! Command line and exit codes that the programs of the project share.

use crate::{Context, Remote};
use serde::{Deserialize, Serialize};
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
    /// `--set` of the command line.
    pub overrides: Vec<String>,
    /// The stage's table.
    pub table: String,
    /// Its host, if it is another one.
    #[serde(default)]
    pub remote: Option<Remote>,
}

/// Argument of `--check`; the answer is a list of [`Problem`](settings::Problem).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckRequest {
    /// The launch file.
    pub launch_file: PathBuf,
    /// `--set` of the command line.
    pub overrides: Vec<String>,
    /// The stage's table.
    pub table: String,
    /// Where the run will happen.
    pub context: Context,
    /// Its host, if it is another one.
    #[serde(default)]
    pub remote: Option<Remote>,
}
