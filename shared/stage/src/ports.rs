//! The typed ends of a stage's topics in shared memory. The runner uses them without their types.

mod context;
mod input;
mod numbering;
mod output;
mod pending;
mod untyped_output;
mod waiter;

pub(crate) use context::{Clock, PortContext};
pub(crate) use input::{TickedInput, shared_input};
pub(crate) use numbering::next_number;
pub(crate) use output::shared_output;
pub(crate) use waiter::Waiter;

use crate::StepError;
use crate::outputs::AnyOutput;
use run::assignment::TopicChannels;

pub(crate) type SharedInputMaker =
    fn(&PortContext, &TopicChannels, port: &'static str, consumer: &str) -> Result<Box<dyn TickedInput>, StepError>;
pub(crate) type SharedOutputMaker = fn(&PortContext, &TopicChannels) -> Result<Box<dyn AnyOutput>, StepError>;
