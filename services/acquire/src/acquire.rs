//! The stage: a recorded drive or a live sensor, depending on the run's mode.

use crate::Settings;
use crate::live::Live;
use crate::recorded::Recorded;
use messages::{GnssTopic, ImageTopic, ImuTopic, MosaicTopic, SweepTopic};
use stage::{Context, Flow, Inputs, Mode, Outputs, Port, Problem, Stage, StepError};

/// The stage; see the crate's page.
pub struct Acquire(Source);

enum Source {
    Recorded(Box<Recorded>),
    Live(Box<Live>),
}

impl Stage for Acquire {
    const NAME: &'static str = "acquire";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        Vec::new()
    }

    fn outputs() -> Vec<Port> {
        vec![
            Port::of::<SweepTopic>(),
            Port::of::<ImageTopic>(),
            Port::of::<MosaicTopic>(),
            Port::of::<GnssTopic>(),
            Port::of::<ImuTopic>(),
        ]
    }

    fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        match context.mode {
            Mode::Offline => Recorded::check(settings, context),
            Mode::Live => Live::check(settings, context),
        }
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        Ok(Self(match context.mode {
            Mode::Offline => Source::Recorded(Box::new(Recorded::open(settings, context)?)),
            Mode::Live => Source::Live(Box::new(Live::open(settings, context)?)),
        }))
    }

    fn step(&mut self, _inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        match &mut self.0 {
            Source::Recorded(drive) => drive.step(outputs),
            Source::Live(sensor) => sensor.step(outputs),
        }
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        match &mut self.0 {
            Source::Recorded(drive) => {
                drive.finish(outputs);
                Ok(())
            }
            Source::Live(sensor) => sensor.finish(outputs),
        }
    }

    fn save(&mut self) -> Result<stage::StateBytes<'_>, StepError> {
        let bytes = match &mut self.0 {
            Source::Recorded(drive) => drive.save(),
            Source::Live(_) => Live::save(),
        };
        Ok(bytes?.into())
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        match &mut self.0 {
            Source::Recorded(drive) => drive.load(state),
            Source::Live(_) => Live::load(state),
        }
    }
}
