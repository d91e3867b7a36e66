//! A program that describes itself as the relay and opens topic `class` with another version.

use stage::messages::{ClassTopic, Message, SweepTopic};
use stage::{Context, Flow, Inputs, Outputs, Port, Stage, StepError};

/// The relay with another version of its output.
pub struct Liar;

/// `class` with a version that no other program has.
struct OtherClass;

impl Message for OtherClass {
    const TOPIC: &'static str = ClassTopic::TOPIC;
    const VERSION: u32 = ClassTopic::VERSION + 1;
    const QUEUE: usize = ClassTopic::QUEUE;
    const BORROWED: usize = ClassTopic::BORROWED;
    const MAX_ROWS: usize = ClassTopic::MAX_ROWS;
    type Header = <ClassTopic as Message>::Header;
    type Row = <ClassTopic as Message>::Row;
}

impl Stage for Liar {
    const NAME: &'static str = "relay";
    type Settings = crate::SinkSettings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<SweepTopic>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<OtherClass>()]
    }

    fn new(_settings: &Self::Settings, _context: &Context) -> Result<Self, StepError> {
        Ok(Self)
    }

    fn step(&mut self, _inputs: &mut Inputs, _outputs: &mut Outputs) -> Result<Flow, StepError> {
        Ok(Flow::Continue)
    }

    fn save(&mut self) -> Result<stage::StateBytes<'_>, StepError> {
        Ok(stage::StateBytes::default())
    }

    fn load(&mut self, _state: &[u8]) -> Result<(), StepError> {
        Ok(())
    }
}
