//! A stage as trait objects. With these instead of a type parameter, the runner, the command line and the run alone are
//! compiled once, in this crate, and not in every program. A stage that is known only at run time, such as a stage in
//! another language, implements them itself and uses the messages of [`crate::untyped`].

use crate::{
    Context, Field, Flow, Inputs, Outputs, Port, Problem, Settings, Stage, StateBytes, StepError, parse_table,
};
use std::marker::PhantomData;
use std::path::Path;
use toml::de::DeTable;

/// A stage before it has settings. See [`Stage`].
pub trait Program {
    /// See [`Stage::NAME`].
    fn name(&self) -> &'static str;
    /// See [`Stage::inputs`].
    fn inputs(&self) -> Vec<Port>;
    /// See [`Stage::outputs`].
    fn outputs(&self) -> Vec<Port>;
    /// See [`Settings::fields`].
    fn fields(&self) -> Vec<Field>;
    /// The stage with the settings of `table`, and the problems of the settings that keep their default.
    fn configured(&self, table: &DeTable<'_>) -> (Box<dyn ConfiguredStage>, Vec<Problem>);
}

/// A stage with its settings, not built yet. See [`Stage`].
pub trait ConfiguredStage {
    /// See [`Stage::inputs_with`].
    fn inputs(&self, launch_folder: &Path) -> Result<Vec<Port>, StepError>;
    /// See [`Stage::outputs_with`].
    fn outputs(&self, launch_folder: &Path) -> Result<Vec<Port>, StepError>;
    /// See [`Stage::check`].
    fn check(&self, context: &Context) -> Vec<Problem>;
    /// All settings as JSON, for the head of a recording.
    fn settings_json(&self) -> Result<String, StepError>;
    /// See [`Stage::new`].
    fn build(&self, context: &Context) -> Result<Box<dyn RunningStage>, StepError>;
}

/// A stage that takes steps. See [`Stage`].
pub trait RunningStage {
    /// See [`Stage::step`].
    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError>;
    /// See [`Stage::finish`].
    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError>;
    /// See [`Stage::save`].
    fn save(&mut self) -> Result<StateBytes<'_>, StepError>;
    /// See [`Stage::load`].
    fn load(&mut self, state: &[u8]) -> Result<(), StepError>;
}

/// The program of stage `S`.
pub(crate) struct ProgramOf<S>(PhantomData<S>);

impl<S> ProgramOf<S> {
    pub(crate) fn new() -> Self {
        Self(PhantomData)
    }
}

impl<S: Stage> Program for ProgramOf<S> {
    fn name(&self) -> &'static str {
        S::NAME
    }
    fn inputs(&self) -> Vec<Port> {
        S::inputs()
    }
    fn outputs(&self) -> Vec<Port> {
        S::outputs()
    }
    fn fields(&self) -> Vec<Field> {
        S::Settings::fields()
    }
    fn configured(&self, table: &DeTable<'_>) -> (Box<dyn ConfiguredStage>, Vec<Problem>) {
        let (settings, problems) = parse_table::<S::Settings>(table);
        (Box::new(Configured::<S> { settings }), problems)
    }
}

struct Configured<S: Stage> {
    settings: S::Settings,
}

impl<S: Stage> ConfiguredStage for Configured<S> {
    fn inputs(&self, launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        S::inputs_with(&self.settings, launch_folder)
    }
    fn outputs(&self, launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        S::outputs_with(&self.settings, launch_folder)
    }
    fn check(&self, context: &Context) -> Vec<Problem> {
        S::check(&self.settings, context)
    }
    fn settings_json(&self) -> Result<String, StepError> {
        serde_json::to_string(&self.settings).map_err(StepError::data)
    }
    fn build(&self, context: &Context) -> Result<Box<dyn RunningStage>, StepError> {
        Ok(Box::new(Built(S::new(&self.settings, context)?)))
    }
}

struct Built<S>(S);

impl<S: Stage> RunningStage for Built<S> {
    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.0.step(inputs, outputs)
    }
    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.0.finish(outputs)
    }
    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        self.0.save()
    }
    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        self.0.load(state)
    }
}
