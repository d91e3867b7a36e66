//! The typed ends of a stage's topics in shared memory, and what the runner does with them without knowing the type.

mod input;
mod numbering;
mod output;
mod waiter;

pub(crate) use input::{TickedInput, shared_input};
pub(crate) use numbering::beyond;
pub(crate) use output::{SharedOutput, TickedOutput, shared_output};
pub(crate) use waiter::Waiter;

use crate::StepError;
use crate::access::AnyOutput;
use crate::assignment::TopicChannels;
use ipc::Node;
use std::cell::Cell;
use std::rc::Rc;

/// The tick that a stage is in.
#[derive(Default)]
pub(crate) struct Clock {
    pub(crate) tick: Cell<u64>,
    pub(crate) born_nanos: Cell<u64>,
}

/// What all ports of a stage share.
#[derive(Clone)]
pub(crate) struct PortContext {
    pub(crate) node: Rc<Node>,
    pub(crate) waiter: Rc<Waiter>,
    pub(crate) clock: Rc<Clock>,
}

pub(crate) type SharedInputMaker =
    fn(&PortContext, &TopicChannels, consumer: &str) -> Result<Box<dyn TickedInput>, StepError>;
pub(crate) type SharedOutputMaker = fn(&PortContext, &TopicChannels) -> Result<Box<dyn AnyOutput>, StepError>;
