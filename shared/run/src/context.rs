//! Where and how a run happens.

use messages::Message;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Where and how the run happens. Paths are absolute.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Context {
    /// The drive's folder. Live: the manifest with the mounting of the sensors (`run.rig`), or a drive folder with one.
    pub drive: PathBuf,
    /// Where results go.
    pub output: PathBuf,
    /// Folder of launch.toml; relative paths in settings start here. See [`Context::resolve`].
    pub launch_folder: PathBuf,
    /// See [`Mode`].
    pub mode: Mode,
    /// Topics that have a producer in this run. An optional input that has been empty so far may still be connected:
    /// ask [`Context::is_connected`].
    pub connected: Vec<String>,
    /// Topics that stages of this run read and that have no producer, because another source replaces their stage
    /// (`--source`).
    pub missing: Vec<String>,
}

impl Context {
    /// A path from the settings, made absolute.
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.launch_folder.join(path)
    }
    /// Whether a stage of this run publishes the topic of `T`.
    pub fn is_connected<T: Message>(&self) -> bool {
        self.connected.iter().any(|topic| topic == T::TOPIC)
    }
}

/// Lossless or newest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Lossless and deterministic: a fast stage waits for a slow one.
    Offline,
    /// Bounded latency: the oldest unprocessed message is dropped and counted.
    Live,
}
