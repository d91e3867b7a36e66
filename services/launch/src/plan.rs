//! A checked launch file: all data that a run needs.

use crate::manifest::{Run, StageTable};
use ipc::Domain;
use run::assignment::{Description, TopicChannels};
use run::wiring::{WiredStage, WiredTopic, Wiring};
use run::{Change, Context, Remote};
use std::path::PathBuf;

/// The selected stages of the launch file, and the recorded topics.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// The source's table; the stages that it replaces are left out.
    pub source: Option<String>,
    /// Tables left out.
    pub without: Vec<String>,
    /// Topics to record.
    pub recorded: Vec<String>,
}

/// All data that a run needs, checked.
pub struct Plan {
    /// The launch file, absolute.
    pub launch_file: PathBuf,
    /// Changes of the command line and of completed swaps.
    pub changes: Vec<Change>,
    /// Settings of the table `[run]`.
    pub settings: Run,
    /// Arguments of `replica` that simulate the drive, if it must be simulated.
    pub simulate: Option<Vec<String>>,
    /// The context of every stage.
    pub context: Context,
    /// The stages in dataflow order.
    pub stages: Vec<PlannedStage>,
    /// The selection of the command line.
    pub selection: Selection,
    /// A remark for the operator about the selection.
    pub remark: Option<String>,
}

impl Plan {
    /// The description of the plan for observers.
    pub fn wiring(&self, domain: &Domain, attempt: u32) -> Wiring {
        let stages = self.stages.iter().map(PlannedStage::wired).collect();
        let supervisor = std::process::id();
        Wiring { domain: domain.name().to_owned(), supervisor, attempt, mode: self.context.mode, stages }
    }
}

/// One stage of the run.
#[derive(Clone, Debug)]
pub struct PlannedStage {
    /// Its table.
    pub name: String,
    /// Position of the table in the launch file.
    pub span: Option<std::ops::Range<usize>>,
    /// Its binary.
    pub program: PathBuf,
    /// The supervisor's keys of its table.
    pub table: StageTable,
    /// Its host, if it is another one; `program` is then its proxy here.
    pub remote: Option<Remote>,
    /// Its topics and settings.
    pub description: Description,
    /// Files that its settings name, such as its model.
    pub files: Vec<PathBuf>,
    /// Topics that it reads and that have a producer.
    pub inputs: Vec<TopicChannels>,
    /// Topics that it writes.
    pub outputs: Vec<TopicChannels>,
}

impl PlannedStage {
    fn wired(&self) -> WiredStage {
        let outputs = self.outputs.iter().filter_map(|channels| {
            let port = self.description.outputs.iter().find(|port| port.topic == channels.topic)?;
            Some(WiredTopic::new(channels, port))
        });
        WiredStage {
            name: self.name.clone(),
            program: self.program.clone(),
            inputs: self.inputs.iter().map(|channels| channels.topic.clone()).collect(),
            outputs: outputs.collect(),
        }
    }
}
