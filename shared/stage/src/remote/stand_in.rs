//! The proxy stage in the run for a stage on another host.

use super::connection::{Connect, Far, port, remote_of};
use super::wire::{Answer, LaunchText, MessageBlock, Report, Request};
use crate::program::{ConfiguredStage, Program, RunningStage};
use crate::{Context, Field, Flow, Inputs, Outputs, Port, Problem, StateBytes, StepError};
use messages::pod::bytes_from_rows;
use run::Remote;
use run::assignment::{Assignment, TopicChannels};
use std::collections::BTreeSet;
use std::path::Path;
use toml::de::DeTable;

/// The program of a stage on another host, for the runner.
pub(super) struct RemoteProgram {
    name: &'static str,
    configured: ConfiguredRemote,
}

#[derive(Clone)]
struct ConfiguredRemote {
    /// The stage of the run.
    session: String,
    launch: LaunchText,
    remote: Remote,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
    connect: Connect,
}

impl RemoteProgram {
    pub(super) fn from_assignment(assignment: &Assignment, connect: Connect) -> Result<Self, StepError> {
        let Assignment { stage, domain, launch_file, changes, .. } = assignment;
        // Keyed by the stage's own names; several topics of the run may be merged in one of them.
        let ports = |topics: &[TopicChannels]| {
            let names: BTreeSet<&str> = topics.iter().map(|topic| topic.port.as_str()).collect();
            names.into_iter().map(port).collect::<Result<Vec<_>, _>>()
        };
        let configured = ConfiguredRemote {
            session: format!("{domain}/{stage}"),
            launch: LaunchText::read(launch_file, changes, stage)?,
            remote: remote_of(assignment.remote.as_ref())?.clone(),
            inputs: ports(&assignment.inputs)?,
            outputs: ports(&assignment.outputs)?,
            connect,
        };
        // A process has one stage.
        Ok(Self { name: stage.clone().leak(), configured })
    }
}

/// The supervisor gets topics and settings from `--describe`; this program uses the topics and settings of the
/// assignment.
impl Program for RemoteProgram {
    fn name(&self) -> &'static str {
        self.name
    }
    fn inputs(&self) -> Vec<Port> {
        self.configured.inputs.clone()
    }
    fn outputs(&self) -> Vec<Port> {
        self.configured.outputs.clone()
    }
    fn fields(&self) -> Vec<Field> {
        Vec::new()
    }
    fn configured(&self, _table: &DeTable<'_>) -> (Box<dyn ConfiguredStage>, Vec<Problem>) {
        (Box::new(self.configured.clone()), Vec::new())
    }
}

impl ConfiguredStage for ConfiguredRemote {
    fn inputs(&self, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        Ok(self.inputs.clone())
    }
    fn outputs(&self, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        Ok(self.outputs.clone())
    }
    fn check(&self, _context: &Context) -> Vec<Problem> {
        Vec::new()
    }
    fn settings_json(&self) -> Result<String, StepError> {
        Err(StepError::contract("a stage on another host cannot run alone"))
    }
    fn build(&self, context: &Context) -> Result<Box<dyn RunningStage>, StepError> {
        let connection = (self.connect)(&self.remote, &self.launch.table, Some(&self.session))?;
        let mut far = Far::new(&self.remote, connection);
        let now = far.describe(&self.launch)?.files;
        let before = &self.remote.files;
        if let Some((file, _)) = now.iter().find(|(file, digest)| before.get(*file) != Some(digest)) {
            let text = format!("{file} on {} has changed since the run was started", self.remote.host);
            return Err(StepError::configuration(text));
        }
        far.order(&Request::Open(self.launch.clone(), context.clone()), [])?;
        Ok(Box::new(RemoteStage { far, inputs: self.inputs.clone() }))
    }
}

struct RemoteStage {
    far: Far,
    inputs: Vec<Port>,
}

impl RunningStage for RemoteStage {
    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let mut messages = Vec::new();
        for port in &self.inputs {
            messages.extend(inputs.take_untyped(port).into_iter().map(|message| (port.topic(), message)));
        }
        let parts: Vec<[&[u8]; 3]> = messages
            .iter()
            .map(|(_, message)| {
                [bytes_from_rows(std::slice::from_ref(message.envelope())), message.header(), message.rows()]
            })
            .collect();
        let blocks = messages.iter().zip(&parts).map(|((topic, _), parts)| MessageBlock {
            topic: (*topic).to_owned(),
            n_bytes: parts.iter().map(|part| part.len() as u64).sum(),
        });
        let request = Request::Step(Report::from_outputs(outputs), blocks.collect());
        let far = &mut self.far;
        far.send(&request, parts.into_iter().flatten())?;
        // Their slots are free for the producers while the other host works.
        drop(messages);
        far.publish_answers(outputs)?;
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        let far = &mut self.far;
        far.send(&Request::Finish(Report::from_outputs(outputs)), [])?;
        far.publish_answers(outputs)
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        let far = &mut self.far;
        match far.ask(&Request::Save, [])? {
            Answer::State(lengths) => Ok(StateBytes::from_pieces(far.read_pieces(lengths)?)),
            other => Err(far.unexpected(&other)),
        }
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        self.far.order(&Request::Load(state.len() as u64), [state])
    }
}
