//! Steps of a stage without processes, for the stages' own tests.

use crate::memory_output::take_messages;
use crate::{Context, Flow, Inputs, Mode, Outputs, Port, Received, Stage, StepError};
use messages::{Envelope, Message};
use std::collections::BTreeMap;
use std::path::Path;

/// A context whose three folders are `folder`, offline, with every topic connected: [`Port::all`].
pub fn context(folder: &Path) -> Context {
    Context {
        drive: folder.into(),
        output: folder.into(),
        launch_folder: folder.into(),
        mode: Mode::Offline,
        connected: Port::all().iter().map(|port| port.topic().to_owned()).collect(),
        missing: Vec::new(),
    }
}

/// Calls a stage step by step: [`Bench::send`] messages, [`Bench::tick`], [`Bench::take`] the published messages.
pub struct Bench<S: Stage> {
    /// The stage itself.
    pub stage: S,
    pending: Inputs,
    outputs: Outputs,
    next_seq: BTreeMap<&'static str, u64>,
}

impl<S: Stage> Bench<S> {
    /// Builds the stage.
    pub fn new(settings: &S::Settings, context: &Context) -> Result<Self, StepError> {
        let ports = S::outputs_with(settings, &context.launch_folder)?;
        Ok(Self::with_outputs(S::new(settings, context)?, ports))
    }
    /// A bench with a stage that is built already.
    pub fn with_stage(stage: S) -> Self {
        Self::with_outputs(stage, S::outputs())
    }
    fn with_outputs(stage: S, ports: Vec<Port>) -> Self {
        let mut outputs = Outputs::default();
        for port in ports {
            outputs.by_topic.insert(port.topic(), (port.make.memory_output)());
        }
        Self { stage, pending: Inputs::default(), outputs, next_seq: BTreeMap::new() }
    }
    /// Puts a message into the next tick; its sequence number counts up from 0 by topic.
    pub fn send<T: Message>(&mut self, stamp: i64, header: T::Header, rows: Vec<T::Row>) {
        assert!(S::inputs().iter().any(|port| port.topic() == T::TOPIC), "{} does not read {}", S::NAME, T::TOPIC);
        self.send_named::<T>(T::TOPIC, stamp, header, rows);
    }
    /// [`Bench::send`] to a [port with another name](Port::named).
    pub fn send_named<T: Message>(&mut self, port: &'static str, stamp: i64, header: T::Header, rows: Vec<T::Row>) {
        let next = self.next_seq.entry(port).or_default();
        let envelope = Envelope { seq: *next, stamp, len: rows.len() as u32, ..Envelope::default() };
        *next += 1;
        self.pending.push::<T>(port, Received::in_own_memory(envelope, header, rows));
    }
    /// Adds a message that the stage of another bench published, with its sequence number.
    pub fn forward<T: Message>(&mut self, message: Received<T>) {
        self.pending.push::<T>(T::TOPIC, message);
    }
    /// One step over the messages sent since the last one.
    pub fn tick(&mut self) -> Result<Flow, StepError> {
        self.stage.step(&mut std::mem::take(&mut self.pending), &mut self.outputs)
    }
    /// Ends the stream.
    pub fn finish(&mut self) -> Result<(), StepError> {
        self.stage.finish(&mut self.outputs)
    }
    /// Messages published on the topic of `T` since the last call.
    pub fn take<T: Message>(&mut self) -> Vec<Received<T>> {
        self.take_named(T::TOPIC)
    }
    /// [`Bench::take`] from a [port with another name](Port::named).
    pub fn take_named<T: Message>(&mut self, port: &str) -> Vec<Received<T>> {
        self.outputs.by_topic.get_mut(port).map(|output| take_messages(&mut **output)).unwrap_or_default()
    }
    /// A counter of the run summary.
    pub fn counter(&self, name: &str) -> u64 {
        self.outputs.counters.get(name).copied().unwrap_or_default()
    }
    /// Notes for the operator.
    pub fn notes(&self) -> &[String] {
        &self.outputs.notes
    }
    /// The size of a doubt, if the stage has it.
    pub fn doubt(&self, name: &str) -> Option<f64> {
        self.outputs.doubts.iter().find(|doubt| doubt.name == name).map(|doubt| doubt.size)
    }
    /// The text of a doubt, if the stage has it.
    pub fn doubt_text(&self, name: &str) -> Option<String> {
        self.outputs.doubts.iter().find(|doubt| doubt.name == name).map(|doubt| doubt.text.clone())
    }
    /// The stage after a save, a restart and a load, as after a barrier and a crash.
    pub fn restarted(mut self, settings: &S::Settings, context: &Context) -> Result<Self, StepError> {
        let state = self.stage.save()?.to_vec();
        self.stage = S::new(settings, context)?;
        if !state.is_empty() {
            self.stage.load(&state)?;
        }
        Ok(self)
    }
}
