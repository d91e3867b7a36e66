//! A class of Python as a stage. The object `host` of `replica/_host.py` speaks for the class: texts are JSON.

use crate::session::{self, ReceivedMessage};
use crate::spec::Spec;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde_json::{Map, Value};
use stage::toml::de::DeTable;
use stage::{
    ConfiguredStage, Context, Field, Flow, Inputs, Outputs, Port, Problem, Program, RunningStage, StateBytes, StepError,
};
use std::path::Path;
use std::sync::Arc;

/// The program of a class.
pub struct PythonProgram {
    class: Arc<Class>,
    spec: Spec,
    name: &'static str,
}

/// Data that all states of a stage share.
struct Class {
    host: Py<PyAny>,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
}

impl PythonProgram {
    /// Fails if the class names a topic that does not exist.
    pub fn new(host: Py<PyAny>, spec: Spec) -> Result<Self, String> {
        let required = spec.inputs.iter().map(|topic| port(topic));
        let optional = spec.optional_inputs.iter().map(|topic| Ok(port(topic)?.made_optional()));
        let inputs = required.chain(optional).collect::<Result<_, String>>()?;
        let outputs = spec.outputs.iter().map(|topic| port(topic)).collect::<Result<_, String>>()?;
        // A process has one stage.
        let name = spec.name.clone().leak();
        Ok(Self { class: Arc::new(Class { host, inputs, outputs }), spec, name })
    }
}

fn port(topic: &str) -> Result<Port, String> {
    let known = Port::all();
    let found = known.iter().find(|port| port.topic() == topic).copied();
    found.ok_or_else(|| {
        let known: Vec<&str> = known.iter().map(Port::topic).collect();
        format!("there is no topic {topic:?}; known are {}", known.join(", "))
    })
}

impl Program for PythonProgram {
    fn name(&self) -> &'static str {
        self.name
    }
    fn inputs(&self) -> Vec<Port> {
        self.class.inputs.clone()
    }
    fn outputs(&self) -> Vec<Port> {
        self.class.outputs.clone()
    }
    fn fields(&self) -> Vec<Field> {
        self.spec.settings.iter().map(crate::spec::Setting::field).collect()
    }
    fn configured(&self, table: &DeTable<'_>) -> (Box<dyn ConfiguredStage>, Vec<Problem>) {
        let (values, problems) = self.spec.read(table);
        (Box::new(Configured { class: Arc::clone(&self.class), values }), problems)
    }
}

/// A stage with the settings that differ from the class's defaults.
struct Configured {
    class: Arc<Class>,
    values: Map<String, Value>,
}

impl ConfiguredStage for Configured {
    fn inputs(&self, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        Ok(self.class.inputs.clone())
    }
    fn outputs(&self, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        Ok(self.class.outputs.clone())
    }
    fn check(&self, context: &Context) -> Vec<Problem> {
        let found: Result<Vec<(String, String)>, StepError> =
            arguments(&self.values, context).and_then(|arguments| self.class.call("check", arguments));
        match found {
            Ok(found) => found.into_iter().map(|(key, text)| Problem::for_key(&key, text)).collect(),
            Err(error) => vec![Problem::for_key("", error.to_string())],
        }
    }
    fn settings_json(&self) -> Result<String, StepError> {
        self.class.call("all_settings", (text(&self.values)?,))
    }
    fn build(&self, context: &Context) -> Result<Box<dyn RunningStage>, StepError> {
        self.class.call::<Py<PyAny>>("build", arguments(&self.values, context)?)?;
        session::begin(self.class.outputs.clone());
        Ok(Box::new(Running(Arc::clone(&self.class))))
    }
}

fn text(value: &impl serde::Serialize) -> Result<String, StepError> {
    serde_json::to_string(value).map_err(StepError::data)
}

fn arguments(values: &Map<String, Value>, context: &Context) -> Result<(String, String), StepError> {
    Ok((text(values)?, text(context)?))
}

struct Running(Arc<Class>);

impl RunningStage for Running {
    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let class = &self.0;
        let messages: Vec<ReceivedMessage> = session::receive(inputs, &class.inputs);
        let ended: bool = session::call(outputs, || class.call("step", (messages,)))?;
        for port in &class.inputs {
            class.check_held(port)?;
        }
        Ok(if ended { Flow::End } else { Flow::Continue })
    }
    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        session::call(outputs, || self.0.call::<Py<PyAny>>("finish", ()))?;
        Ok(())
    }
    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        Ok(self.0.call::<Vec<u8>>("save", ())?.into())
    }
    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        Python::attach(|py| {
            let state = PyBytes::new(py, state);
            self.0.host.call_method1(py, "restore", (state,)).map_err(|exception| self.0.explained(py, &exception))
        })?;
        Ok(())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        session::end();
    }
}

impl Class {
    /// Calls a method of the host. The interpreter is locked only during the call.
    fn call<R>(&self, method: &str, arguments: impl for<'py> pyo3::call::PyCallArgs<'py>) -> Result<R, StepError>
    where
        R: for<'a, 'py> FromPyObject<'a, 'py>,
    {
        Python::attach(|py| {
            let result = self.host.bind(py).call_method1(method, arguments);
            result.and_then(|value| value.extract::<R>().map_err(Into::into)).map_err(|e| self.explained(py, &e))
        })
    }

    /// The error that ends the stage. The traceback is logged before it, as the backtrace of a panic is.
    fn explained(&self, py: Python<'_>, exception: &PyErr) -> StepError {
        let explained = self.host.call_method1(py, "explain", (exception.value(py), exception.traceback(py)));
        let explained = explained.and_then(|value| value.extract::<(bool, String, String)>(py));
        match explained {
            Ok((is_configuration, traceback, text)) => {
                if !traceback.is_empty() {
                    tracing::error!("{traceback}");
                }
                if is_configuration { StepError::configuration(text) } else { StepError::data(text) }
            }
            Err(_) => StepError::data(exception.to_string()),
        }
    }

    /// Fails if Python keeps more messages than a stage may keep after its step.
    fn check_held(&self, port: &Port) -> Result<(), StepError> {
        if session::still_held(port.topic()).len() <= port.borrowed() {
            return Ok(());
        }
        // Objects that refer to each other wait for the collector.
        self.call::<Py<PyAny>>("collect", ())?;
        let held = session::still_held(port.topic());
        if held.len() <= port.borrowed() {
            return Ok(());
        }
        Err(StepError::contract(format!(
            "{}: arrays of {} messages (seq {held:?}) are kept after the step, at most {} are allowed; keep copies, as in \
             message[\"x\"].copy()",
            port.topic(),
            held.len(),
            port.borrowed()
        )))
    }
}
