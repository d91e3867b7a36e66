//! The host of a stage that runs on another host.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The host of a stage, from its table in launch.toml. `replica-remote`, its proxy in the run, receives this from the
/// supervisor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Remote {
    /// `HOST:PORT` of the agent.
    pub host: String,
    /// The key file, absolute.
    pub key: PathBuf,
    /// The key `program`: a path in the agent's folder, or a program of the project.
    pub program: String,
    /// The key `python`.
    pub python: String,
    /// The key `threads`.
    pub threads: usize,
    /// Silence of the other host that counts as a fault, s.
    pub hang_s: f64,
    /// Files on that host on which results depend, with their digests at the start of the run.
    pub files: BTreeMap<String, String>,
}
