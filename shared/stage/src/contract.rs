//! What a stage promises, and what it may rely on.
//!
//! Time is cut into *ticks*: one tick is one step of the source (one LiDAR revolution). In tick n a stage gets all
//! messages of tick n, from all its inputs, in the order they were published, and publishes whatever follows from them.
//! Nothing depends on when a message arrives, so the same input gives the same output, always.

use crate::access::AnyOutput;
use crate::assignment::PortDescription;
use crate::ports::{SharedInputMaker, SharedOutputMaker};
use crate::{Inputs, Outputs, Problem, Settings, StateBytes};
use messages::{ByteTable, Message};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// One process of the pipeline, without its process: a function of settings, state and inputs.
///
/// `step` reads no clock, no environment and no unseeded randomness, and logs nothing: what is worth saying goes into
/// [`Outputs::count`] and [`Outputs::note`].
pub trait Stage: Sized {
    /// Folder, crate, table in launch.toml, log target; the binary is `replica-<NAME>`.
    const NAME: &'static str;

    /// See [`settings!`](crate::settings!).
    type Settings: Settings;

    /// Topics that it reads, in the order in which their messages are of one tick are to be thought of.
    fn inputs() -> Vec<Port>;

    /// Topics that it writes.
    fn outputs() -> Vec<Port>;

    /// Topics that it writes with these settings: some or all of [`Stage::outputs`]. `launch_folder` is where relative
    /// paths start.
    fn outputs_with(_settings: &Self::Settings, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        Ok(Self::outputs())
    }

    /// What can be said before the start beyond the settings' own rules: absent files, settings that contradict each other.
    fn check(_settings: &Self::Settings, _context: &Context) -> Vec<Problem> {
        Vec::new()
    }

    /// Makes the stage ready for tick 0. Reads calibration and models; takes no sensor data yet.
    fn new(settings: &Self::Settings, context: &Context) -> Result<Self, StepError>;

    /// One tick. A source (no inputs) says here when it is done.
    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError>;

    /// After the last tick: publish what is still held.
    fn finish(&mut self, _outputs: &mut Outputs) -> Result<(), StepError> {
        Ok(())
    }

    /// Everything that the next tick depends on. Called between ticks, at a barrier; [`crate::encode_state`] helps, and
    /// [`StateBytes::with_head`] where messages are held. A stage that holds nothing between ticks returns no bytes at all:
    /// then any program may take its place.
    fn save(&mut self) -> Result<StateBytes<'_>, StepError>;

    /// Takes up where [`Stage::save`] left off, perhaps that of the program that this one replaces. Called on a new stage
    /// before its first tick, unless there are no bytes. A stage that saves none has none to take up: that is the default.
    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let n_bytes = state.len();
        Err(StepError::Data(format!("this program keeps no state and cannot go on from one of {n_bytes} bytes")))
    }
}

/// Whether a source has more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// There may be a next tick.
    Continue,
    /// This was the last tick. Only sources decide; the answer of other stages is ignored.
    End,
}

/// Where and how the run happens. Paths are absolute.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Context {
    /// The drive's folder.
    pub drive: PathBuf,
    /// Where results go.
    pub output: PathBuf,
    /// Folder of launch.toml; relative paths in settings start here. See [`Context::resolve`].
    pub launch_folder: PathBuf,
    /// See [`Mode`].
    pub mode: Mode,
    /// Topics that have a producer in this run. What an optional input brings cannot be told from what has arrived so
    /// far; it can from this. See [`Context::is_connected`].
    pub connected: Vec<String>,
}

impl Context {
    /// A path from the settings, made absolute.
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.launch_folder.join(path)
    }
    /// Whether anybody produces the topic of `T` in this run.
    pub fn is_connected<T: Message>(&self) -> bool {
        self.connected.iter().any(|topic| topic == T::TOPIC)
    }
}

/// Lossless or newest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Lossless and deterministic: who is ahead waits.
    Offline,
    /// Bounded latency: the oldest unprocessed message is dropped and counted.
    Live,
}

/// One topic that a stage reads or writes, by type.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    pub(crate) topic: &'static str,
    version: u32,
    layout: u64,
    queue: usize,
    borrowed: usize,
    optional: bool,
    pub(crate) make: PortMakers,
}

/// How the runner and the test bench make the typed halves of a port.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PortMakers {
    pub(crate) memory_output: fn() -> Box<dyn AnyOutput>,
    pub(crate) shared_output: SharedOutputMaker,
    pub(crate) shared_input: SharedInputMaker,
    pub(crate) push_bytes: fn(&mut Inputs, &[u8]) -> Result<(), StepError>,
    pub(crate) byte_table: fn() -> ByteTable,
}

impl Port {
    /// The topic of `T`. As an input: the run does not start unless somebody produces it.
    pub fn of<T: Message>() -> Self {
        Self {
            topic: T::TOPIC,
            version: T::VERSION,
            layout: T::LAYOUT,
            queue: T::QUEUE,
            borrowed: T::BORROWED,
            optional: false,
            make: PortMakers {
                memory_output: crate::access::memory_output::<T>,
                shared_output: crate::ports::shared_output::<T>,
                shared_input: crate::ports::shared_input::<T>,
                push_bytes: crate::access::push_bytes::<T>,
                byte_table: ByteTable::of::<T>,
            },
        }
    }

    /// As [`Port::of`]; as an input it may have no producer, then it is always empty.
    pub fn optional<T: Message>() -> Self {
        Self { optional: true, ..Self::of::<T>() }
    }

    /// The topic's name.
    pub fn topic(&self) -> &'static str {
        self.topic
    }

    /// As the supervisor sees it.
    pub(crate) fn describe(&self) -> PortDescription {
        PortDescription {
            topic: self.topic.to_owned(),
            version: self.version,
            layout: self.layout,
            queue: self.queue,
            borrowed: self.borrowed,
            optional: self.optional,
            table: (self.make.byte_table)(),
        }
    }
}

/// Why a stage cannot go on. The text names the file or message, the place, the value and the rule.
#[derive(Debug, thiserror::Error)]
pub enum StepError {
    /// Input that the stage cannot work with.
    #[error("{0}")]
    Data(String),
    /// A file or the operating system.
    #[error("{0}")]
    Io(String),
    /// The run is being stopped; not a failure of the stage.
    #[error("stopped while waiting to publish on {topic}")]
    Stopped {
        /// Where it waited.
        topic: &'static str,
    },
    /// Shared memory.
    #[error(transparent)]
    Ipc(#[from] ipc::IpcError),
    /// The stage broke the contract, e.g. published a column for the wrong submap.
    #[error("{0}")]
    Contract(String),
}

impl StepError {
    /// An input that the stage cannot work with.
    pub fn data(error: impl std::fmt::Display) -> Self {
        StepError::Data(error.to_string())
    }
    /// A file or the operating system.
    pub fn io(error: impl std::fmt::Display) -> Self {
        StepError::Io(error.to_string())
    }
}
