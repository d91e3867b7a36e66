//! A program that describes itself as the relay and then opens topic `class` as another version.

use stage::messages::{Class, Message, Sweep};
use stage::{Context, Flow, Inputs, Outputs, Port, Stage, StepError};

/// The relay of another day.
pub struct Liar;

/// `class` as nobody here knows it.
struct OtherClass;

impl Message for OtherClass {
    const TOPIC: &'static str = Class::TOPIC;
    const VERSION: u32 = Class::VERSION + 1;
    const QUEUE: usize = Class::QUEUE;
    const BORROWED: usize = Class::BORROWED;
    const MAX_ROWS: usize = Class::MAX_ROWS;
    type Header = <Class as Message>::Header;
    type Row = <Class as Message>::Row;
}

impl Stage for Liar {
    const NAME: &'static str = "relay";
    type Settings = crate::SinkSettings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<Sweep>()]
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
