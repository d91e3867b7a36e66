//! The assignment of a stage at its start, and the supervisor's commands while the stage runs.

use crate::health::Traffic;
use crate::{Change, Context, Remote};
use ipc::Channel;
use messages::ByteTable;
use serde::{Deserialize, Serialize};
use settings::Field;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Version of the interface. Raised when supervisor and stages of different versions could misunderstand each other.
pub const CONTRACT_VERSION: u32 = 6;

/// Answer to `--describe`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// [`CONTRACT_VERSION`].
    pub contract: u32,
    /// Name of the stage.
    pub name: String,
    /// Topics that it reads.
    pub inputs: Vec<PortDescription>,
    /// Topics that it writes.
    pub outputs: Vec<PortDescription>,
    /// Its settings.
    pub settings: Vec<Field>,
    /// Files of another host on which its results depend, with their digests.
    #[serde(default)]
    pub files: BTreeMap<String, String>,
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

/// A topic's two channels: its messages and its ticks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicChannels {
    /// Name of the topic in the run.
    pub topic: String,
    /// The stage's own name of the topic. The key `remap` of its table may give a port another topic, or several.
    pub port: String,
    /// Messages.
    pub messages: Channel,
    /// Ticks.
    pub ticks: Channel,
}

/// Everything that the process of a stage needs to run.
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
    /// Changes of the command line and of swaps.
    pub changes: Vec<Change>,
    /// Topics that it reads and that have a producer.
    pub inputs: Vec<TopicChannels>,
    /// Topics that it writes.
    pub outputs: Vec<TopicChannels>,
    /// Drive time between barriers, s.
    pub barrier_s: f64,
    /// Folder of saved states: `<barrier>/<stage>.state`.
    pub states: PathBuf,
    /// Barrier to resume from.
    pub resume: Option<u64>,
    /// Live: only this stage is restarted, in a run that continues.
    pub restart: Option<Restart>,
    /// Host of the stage, if it is another host.
    #[serde(default)]
    pub remote: Option<Remote>,
}

/// The state of the process that a restarted stage replaces.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Restart {
    /// Number of the restart: 1, 2, 3 …
    pub epoch: u32,
    /// Ticks in the last heartbeat.
    pub ticks: u64,
    /// Inputs in the last heartbeat.
    pub inputs: BTreeMap<String, Traffic>,
    /// Outputs in the last heartbeat.
    pub outputs: BTreeMap<String, Traffic>,
}

impl Assignment {
    /// File of the state at a barrier.
    pub fn state_file(&self, barrier: u64) -> PathBuf {
        state_file(&self.states, barrier, &self.stage)
    }
    /// File of the state at a barrier of the stage that produces the topic.
    pub fn producers_state_file(&self, barrier: u64, channels: &TopicChannels) -> PathBuf {
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

/// A command of the supervisor. It is published repeatedly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(clippy::struct_excessive_bools, reason = "each flag is independent of the others")]
pub struct Command {
    /// All stages are ready: sources may start.
    pub go: bool,
    /// Sources end at the next tick; in-flight data is drained.
    pub drain: bool,
    /// Sources mark the next tick as a barrier and wait after it until this is false again.
    pub pause: bool,
    /// The supervisor has received a heartbeat of this process, so it will receive the last one: the process may end.
    pub heard: bool,
    /// End of the time in which the stage may begin a step, on the clock of [`crate::process::boottime_nanos`]: until then no
    /// other run writes into the output. 0: before the first command. `u64::MAX`: without end.
    pub valid_until_nanos: u64,
}
