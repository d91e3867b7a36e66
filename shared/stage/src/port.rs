//! A topic that a stage reads or writes.

use crate::inputs::push_bytes;
use crate::memory_output::memory_output;
use crate::outputs::AnyOutput;
use crate::ports::{SharedInputMaker, SharedOutputMaker, shared_input, shared_output};
use crate::{Inputs, StepError};
use messages::{ByteTable, Message};
use run::assignment::PortDescription;

/// One topic that a stage reads or writes, by type.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    topic: &'static str,
    version: u32,
    layout: u64,
    queue: usize,
    borrowed: usize,
    optional: bool,
    pub(crate) make: PortMakers,
}

/// Constructors of the typed ends of a port, for the runner and the test bench.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PortMakers {
    pub(crate) memory_output: fn() -> Box<dyn AnyOutput>,
    pub(crate) shared_output: SharedOutputMaker,
    pub(crate) shared_input: SharedInputMaker,
    pub(crate) push_bytes: fn(&mut Inputs, &[u8]) -> Result<(), StepError>,
    pub(crate) byte_table: fn() -> ByteTable,
}

impl Port {
    /// The topic of `T`. As an input: the run does not start unless a stage produces it.
    pub fn of<T: Message>() -> Self {
        Self {
            topic: T::TOPIC,
            version: T::VERSION,
            layout: T::LAYOUT,
            queue: T::QUEUE,
            borrowed: T::BORROWED,
            optional: false,
            make: PortMakers {
                memory_output: memory_output::<T>,
                shared_output: shared_output::<T>,
                shared_input: shared_input::<T>,
                push_bytes: push_bytes::<T>,
                byte_table: ByteTable::of::<T>,
            },
        }
    }

    /// As [`Port::of`]; an input without a producer is always empty.
    pub fn optional<T: Message>() -> Self {
        Self { optional: true, ..Self::of::<T>() }
    }

    /// The topic's name.
    pub fn topic(&self) -> &'static str {
        self.topic
    }

    /// As the supervisor sees it.
    pub(crate) fn describe(&self) -> PortDescription {
        PortDescription {
            topic: self.topic.to_owned(),
            version: self.version,
            layout: self.layout,
            queue: self.queue,
            borrowed: self.borrowed,
            optional: self.optional,
            table: (self.make.byte_table)(),
        }
    }
}
