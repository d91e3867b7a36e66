//! What those who look at a run from outside must know: `<output>/run/wiring.json`.

use crate::Mode;
use crate::assignment::{PortDescription, TopicChannels};
use crate::process::open_files;
use ipc::Channel;
use messages::ByteTable;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A run's processes and topics. Written anew by the supervisor at each attempt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wiring {
    /// Domain of the run ([`ipc::Domain`]).
    pub domain: String,
    /// Process id of the supervisor.
    pub supervisor: u32,
    /// 0, 1, 2 …: how often the processes have been started anew. Each attempt has services of its own.
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

impl Wiring {
    /// Where a run into `output` keeps it.
    pub fn file(output: &Path) -> PathBuf {
        output.join("run/wiring.json")
    }

    /// Reads the wiring of the run into `output`. The error is a sentence.
    pub fn read(output: &Path) -> Result<Self, String> {
        let path = Self::file(output);
        let bytes = std::fs::read(&path)
            .map_err(|error| format!("no run in {}: {}: {error}", output.display(), path.display()))?;
        serde_json::from_slice(&bytes).map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Whether the supervisor that wrote it is at work: it has the lock of the run into `output` (absolute, without links)
    /// open. Another process that got its number has not.
    pub fn is_alive(&self, output: &Path) -> bool {
        let lock = output.join("run/lock");
        open_files(self.supervisor).any(|file| file == lock)
    }

    /// All topics in the order of the dataflow, each with its producer.
    pub fn topics(&self) -> impl Iterator<Item = (&WiredStage, &WiredTopic)> {
        self.stages.iter().flat_map(|stage| stage.outputs.iter().map(move |topic| (stage, topic)))
    }

    /// The topic called `name`; the error names those that there are.
    pub fn topic(&self, name: &str) -> Result<&WiredTopic, String> {
        let found = self.topics().find(|(_, topic)| topic.channels.topic == name);
        found.map(|(_, topic)| topic).ok_or_else(|| {
            let names: Vec<&str> = self.topics().map(|(_, topic)| topic.channels.topic.as_str()).collect();
            format!("no topic {name} in this run; there are {}", names.join(", "))
        })
    }
}

impl WiredTopic {
    /// From a stage's description and the channels that its run gave it.
    pub fn new(channels: &TopicChannels, port: &PortDescription) -> Self {
        Self { channels: channels.clone(), table: port.table.clone() }
    }
    /// The channel of the messages.
    pub fn messages(&self) -> &Channel {
        &self.channels.messages
    }
}
