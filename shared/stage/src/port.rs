//! A topic that a stage reads or writes.

use crate::inputs::push_bytes;
use crate::memory_output::{memory_output, remote_output};
use crate::outputs::AnyOutput;
use crate::ports::{SharedInputMaker, SharedOutputMaker, shared_input, shared_output};
use crate::submap_join::{self, WaitingMaker};
use crate::untyped::{self, FirstMaker, LoanMaker, UntypedLoan, UntypedMessage};
use crate::{ColumnPort, Inputs, Outputs, StepError};
use messages::{
    ByteTable, CubeTopic, GnssTopic, ImageTopic, ImuTopic, Message, MosaicTopic, PlacementTopic, SubmapTopic,
    SweepTopic, TrajectoryTopic,
};
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
    pub(crate) remote_output: fn() -> Box<dyn AnyOutput>,
    pub(crate) shared_output: SharedOutputMaker,
    pub(crate) shared_input: SharedInputMaker,
    pub(crate) push_bytes: fn(&mut Inputs, &'static str, &[u8]) -> Result<(), StepError>,
    pub(crate) byte_table: fn() -> ByteTable,
    pub(crate) first: FirstMaker,
    pub(crate) waiting: WaitingMaker,
    pub(crate) take: fn(&mut Inputs, &str) -> Vec<Box<dyn UntypedMessage>>,
    pub(crate) publish_bytes: fn(&mut Outputs, &str, &[u8]) -> Result<(), StepError>,
    pub(crate) loan: LoanMaker,
}

impl Port {
    /// The topic of `T`. As an input, it must have a producer: otherwise the run does not start.
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
                remote_output: remote_output::<T>,
                shared_output: shared_output::<T>,
                shared_input: shared_input::<T>,
                push_bytes: push_bytes::<T>,
                byte_table: ByteTable::of::<T>,
                first: untyped::first::<T>,
                waiting: submap_join::waiting::<T>,
                take: untyped::take::<T>,
                publish_bytes: untyped::publish_bytes::<T>,
                loan: untyped::loan::<T>,
            },
        }
    }

    /// The topic of `T`, as an input that stays empty without a producer.
    pub fn optional<T: Message>() -> Self {
        Self::of::<T>().made_optional()
    }

    /// The project's topics, for programs that select them at run time: columns at the end.
    pub fn all() -> Vec<Self> {
        let mut ports = vec![
            Self::of::<SweepTopic>(),
            Self::of::<ImageTopic>(),
            Self::of::<MosaicTopic>(),
            Self::of::<GnssTopic>(),
            Self::of::<ImuTopic>(),
            Self::of::<CubeTopic>(),
            Self::of::<SubmapTopic>(),
            Self::of::<TrajectoryTopic>(),
            Self::of::<PlacementTopic>(),
        ];
        ports.extend(ColumnPort::all().iter().map(|column| column.port));
        ports
    }

    /// The project's topic of this name.
    pub fn from_name(topic: &str) -> Option<Self> {
        Self::all().into_iter().find(|port| port.topic() == topic)
    }

    /// This port, as an input that stays empty without a producer.
    #[must_use]
    pub fn made_optional(self) -> Self {
        Self { optional: true, ..self }
    }

    /// This port under another name, for a further topic of the type: [`Inputs::take_named`] reads it,
    /// [`Outputs::publish_bytes`] writes it.
    #[must_use]
    pub fn named(self, topic: &str) -> Self {
        // Names come from settings: a process makes a few, and needs them to its end.
        Self { topic: Box::leak(topic.to_owned().into_boxed_str()), ..self }
    }

    /// The topic's name.
    pub fn topic(&self) -> &'static str {
        self.topic
    }

    /// Messages of the topic that a stage may keep after its step.
    pub fn borrowed(&self) -> usize {
        self.borrowed
    }

    /// The layout of the topic's messages.
    pub fn byte_table(&self) -> ByteTable {
        ByteTable { topic: self.topic.to_owned(), ..(self.make.byte_table)() }
    }

    /// The description for the supervisor.
    pub(crate) fn describe(&self) -> PortDescription {
        PortDescription {
            topic: self.topic.to_owned(),
            version: self.version,
            layout: self.layout,
            queue: self.queue,
            borrowed: self.borrowed,
            optional: self.optional,
            table: self.byte_table(),
        }
    }
}

impl Inputs {
    /// [`Inputs::take`] of the port's topic.
    pub fn take_untyped(&mut self, port: &Port) -> Vec<Box<dyn UntypedMessage>> {
        (port.make.take)(self, port.topic())
    }
}

impl Outputs {
    /// Publishes a message that was kept as bytes ([`Received::to_bytes`](ipc::Received::to_bytes)), under the next number of the topic.
    pub fn publish_bytes(&mut self, port: &Port, bytes: &[u8]) -> Result<(), StepError> {
        (port.make.publish_bytes)(self, port.topic(), bytes)
    }

    /// A loan of the port's topic with `n_rows` zeroed rows.
    pub fn loan_untyped(&mut self, port: &Port, n_rows: usize) -> Result<Box<dyn UntypedLoan>, StepError> {
        (port.make.loan)(self, n_rows)
    }
}
