//! What a checked launch file comes to.

use crate::manifest::{Run, Simulate, StageTable};
use stage::Context;
use stage::assignment::{Description, TopicChannels};
use std::path::PathBuf;

/// Everything that a run needs to know; nothing in it is in doubt any more.
pub struct Plan {
    /// The launch file, absolute.
    pub launch_file: PathBuf,
    /// `--set` of the command line.
    pub overrides: Vec<String>,
    /// `[run]`.
    pub run: Run,
    /// `[simulate]`, if the drive has to be made.
    pub simulate: Option<Simulate>,
    /// Handed to every stage.
    pub context: Context,
    /// The stages in the order of the dataflow.
    pub stages: Vec<PlannedStage>,
}

/// One stage of the run.
#[derive(Clone, Debug)]
pub struct PlannedStage {
    /// Its table.
    pub name: String,
    /// Where the table stands in the launch file.
    pub span: Option<std::ops::Range<usize>>,
    /// Its binary.
    pub program: PathBuf,
    /// The supervisor's keys of its table.
    pub table: StageTable,
    /// What it says of itself.
    pub description: Description,
    /// Topics that it reads and that have a producer.
    pub inputs: Vec<TopicChannels>,
    /// Topics that it writes.
    pub outputs: Vec<TopicChannels>,
}
