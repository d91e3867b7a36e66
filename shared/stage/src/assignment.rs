//! What the supervisor hands to a stage at its start, and what it tells it while it runs.

use crate::health::Traffic;
use crate::{Context, Field, Port, Settings, Stage};
use ipc::Channel;
use messages::ByteTable;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Raised when the supervisor and stages of different ages could misunderstand each other.
pub const CONTRACT_VERSION: u32 = 4;

/// Answer to `--describe`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// [`CONTRACT_VERSION`].
    pub contract: u32,
    /// [`Stage::NAME`].
    pub name: String,
    /// Topics that it reads.
    pub inputs: Vec<PortDescription>,
    /// Topics that it writes.
    pub outputs: Vec<PortDescription>,
    /// Its settings.
    pub settings: Vec<Field>,
}

/// A topic and its type.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PortDescription {
    /// Name.
    pub topic: String,
    /// [`messages::Message::VERSION`].
    pub version: u32,
    /// [`messages::Message::LAYOUT`].
    pub layout: u64,
    /// [`messages::Message::QUEUE`].
    pub queue: usize,
    /// [`messages::Message::BORROWED`].
    pub borrowed: usize,
    /// An input that may lack a producer.
    pub optional: bool,
    /// Layout of the messages.
    pub table: ByteTable,
}

impl Description {
    /// Of a stage.
    pub fn of<S: Stage>() -> Self {
        let describe = |port: &Port| port.describe();
        Self {
            contract: CONTRACT_VERSION,
            name: S::NAME.to_owned(),
            inputs: S::inputs().iter().map(describe).collect(),
            outputs: S::outputs().iter().map(describe).collect(),
            settings: S::Settings::fields(),
        }
    }
}

/// A topic's two channels: its messages and its ticks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicChannels {
    /// Name of the topic.
    pub topic: String,
    /// Messages.
    pub messages: Channel,
    /// Ticks.
    pub ticks: Channel,
}

/// Everything that a stage process needs to know to run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Assignment {
    /// Table in launch.toml: the stage's name in this run.
    pub stage: String,
    /// Domain of the run ([`ipc::Domain`]).
    pub domain: String,
    /// Process id of the supervisor.
    pub supervisor: u32,
    /// Drive, output, mode.
    pub context: Context,
    /// The launch file.
    pub launch_file: PathBuf,
    /// `--set` of the command line and what swaps have changed.
    pub overrides: Vec<String>,
    /// Topics that it reads and that have a producer.
    pub inputs: Vec<TopicChannels>,
    /// Topics that it writes.
    pub outputs: Vec<TopicChannels>,
    /// Drive time between barriers, s.
    pub barrier_s: f64,
    /// Folder of saved states: `<barrier>/<stage>.state`.
    pub states: PathBuf,
    /// Barrier to go on from.
    pub resume: Option<u64>,
    /// Live: this stage alone is started anew, in a run that goes on.
    pub restart: Option<Restart>,
}

/// What a stage that is started anew must know of the process that it follows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Restart {
    /// 1, 2, 3 …
    pub epoch: u32,
    /// Ticks as last heard.
    pub ticks: u64,
    /// Inputs as last heard.
    pub inputs: BTreeMap<String, Traffic>,
    /// Outputs as last heard.
    pub outputs: BTreeMap<String, Traffic>,
}

impl Assignment {
    /// File of the state at a barrier.
    pub fn state_file(&self, barrier: u64) -> PathBuf {
        state_file(&self.states, barrier, &self.stage)
    }
    /// File of the state at a barrier of who produces the topic.
    pub(crate) fn producers_state_file(&self, barrier: u64, channels: &TopicChannels) -> PathBuf {
        let wake = &channels.messages.producer;
        state_file(&self.states, barrier, wake.strip_suffix(WAKE).unwrap_or(wake))
    }
}

/// File of a stage's state at a barrier, in the folder of a run's states.
pub fn state_file(states: &Path, barrier: u64, stage: &str) -> PathBuf {
    states.join(barrier.to_string()).join(format!("{stage}.state"))
}

const WAKE: &str = ".wake";

/// Name of the wake on which a stage sleeps.
pub fn wake_name(stage: &str) -> String {
    format!("{stage}{WAKE}")
}

/// What the supervisor tells a stage, over and over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(clippy::struct_excessive_bools, reason = "each is said for itself; no two make a state together")]
pub struct Command {
    /// All are ready: sources may begin.
    pub go: bool,
    /// Sources end at the next tick; everything on the way is finished.
    pub drain: bool,
    /// Sources mark the next tick as a barrier and wait behind it until this is taken back.
    pub pause: bool,
    /// A heartbeat of this process has been heard, so its last will be: only then may it end.
    pub heard: bool,
}
