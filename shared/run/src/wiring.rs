//! Description of a run for observers: `<output>/run/wiring.json`.

use crate::Mode;
use crate::assignment::{PortDescription, TopicChannels};
use crate::process::open_files;
use files::regular_file;
use ipc::Channel;
use messages::ByteTable;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A run's processes and topics. The supervisor writes it at the start of each attempt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wiring {
    /// Domain of the run ([`ipc::Domain`]).
    pub domain: String,
    /// Process id of the supervisor.
    pub supervisor: u32,
    /// Number of restarts of the processes: 0, 1, 2 … Each attempt has its own services.
    pub attempt: u32,
    /// See [`Mode`].
    pub mode: Mode,
    /// The stages in the order of the dataflow.
    pub stages: Vec<WiredStage>,
}

/// One stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WiredStage {
    /// Its table.
    pub name: String,
    /// Its binary.
    pub program: PathBuf,
    /// Topics that it reads and that have a producer.
    pub inputs: Vec<String>,
    /// Topics that it writes.
    pub outputs: Vec<WiredTopic>,
}

/// One topic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WiredTopic {
    /// Its two channels.
    pub channels: TopicChannels,
    /// Layout of its messages.
    pub table: ByteTable,
}

/// Wiring that cannot be read, or does not have a topic.
#[derive(Debug, thiserror::Error)]
pub enum WiringError {
    /// There is no run into the folder.
    #[error("no run in {}: {}: {cause}", output.display(), path.display())]
    NoRun {
        /// Output folder.
        output: PathBuf,
        /// The file.
        path: PathBuf,
        /// Reason why it cannot be read.
        #[source]
        cause: std::io::Error,
    },
    /// The file is not a wiring of this version.
    #[error("{}: {cause}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Parse error with its position.
        #[source]
        cause: serde_json::Error,
    },
    /// No stage of the run publishes the topic.
    #[error("no topic {name} in this run; there are {}", known.join(", "))]
    NoTopic {
        /// Name that was requested.
        name: String,
        /// Topics of the run.
        known: Vec<String>,
    },
}

impl Wiring {
    /// Path of the wiring of a run into `output`.
    pub fn file(output: &Path) -> PathBuf {
        output.join("run/wiring.json")
    }

    /// Reads the wiring of the run into `output`.
    pub fn read(output: &Path) -> Result<Self, WiringError> {
        let path = Self::file(output);
        let bytes = regular_file::read(&path).map_err(|cause| WiringError::NoRun {
            output: output.to_owned(),
            path: path.clone(),
            cause,
        })?;
        serde_json::from_slice(&bytes).map_err(|cause| WiringError::Content { path, cause })
    }

    /// Whether the supervisor that wrote it is running: it has the lock of the run into `output` (absolute, without
    /// links) open. Another process with the same id does not have it open.
    pub fn is_alive(&self, output: &Path) -> bool {
        let lock = output.join("run/lock");
        open_files(self.supervisor).any(|file| file == lock)
    }

    /// All topics in the order of the dataflow, each with its producer.
    pub fn topics(&self) -> impl Iterator<Item = (&WiredStage, &WiredTopic)> {
        self.stages.iter().flat_map(|stage| stage.outputs.iter().map(move |topic| (stage, topic)))
    }

    /// The topic called `name`.
    pub fn topic(&self, name: &str) -> Result<&WiredTopic, WiringError> {
        let found = self.topics().find(|(_, topic)| topic.channels.topic == name);
        found.map(|(_, topic)| topic).ok_or_else(|| WiringError::NoTopic {
            name: name.to_owned(),
            known: self.topics().map(|(_, topic)| topic.channels.topic.clone()).collect(),
        })
    }
}

impl WiredTopic {
    /// The wiring of a topic, from a stage's description and the channels of its run.
    pub fn new(channels: &TopicChannels, port: &PortDescription) -> Self {
        Self { channels: channels.clone(), table: port.table.clone() }
    }
    /// The channel of the messages.
    pub fn messages(&self) -> &Channel {
        &self.channels.messages
    }
}
