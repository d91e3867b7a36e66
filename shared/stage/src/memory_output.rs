//! An output that keeps its messages: for tests, for a stage that runs alone, and for a stage on another host.

use crate::StepError;
use crate::outputs::{AnyOutput, Output, PublishedSink, TypedOutput};
use ipc::{Loan, Received};
use messages::{Envelope, Message};
use std::any::Any;

/// The messages that were published on the topic of `T`.
pub(crate) struct MemoryOutput<T: Message> {
    next_seq: u64,
    published: Vec<Published<T>>,
    /// The run is on another host, which checks the room in its queues and the order of columns. Here all messages are
    /// accepted.
    is_remote: bool,
    /// The submap of the next column to publish.
    column: Option<u64>,
}

struct Published<T: Message> {
    message: Received<T>,
    /// The submap of a column, if the run is on another host.
    column: Option<u64>,
}

pub(crate) fn memory_output<T: Message>() -> Box<dyn AnyOutput> {
    new_output::<T>(false)
}

/// The output of a stage whose run is on another host.
pub(crate) fn remote_output<T: Message>() -> Box<dyn AnyOutput> {
    new_output::<T>(true)
}

fn new_output<T: Message>(is_remote: bool) -> Box<dyn AnyOutput> {
    let next_seq = 0;
    let published = Vec::new();
    let column = None;
    Box::new(TypedOutput::<T>(Box::new(MemoryOutput::<T> { next_seq, published, is_remote, column })))
}

impl<T: Message> Output<T> for MemoryOutput<T> {
    fn loan(&self, capacity: usize) -> Result<Loan<T>, StepError> {
        Ok(Loan::in_own_memory(capacity))
    }

    fn publish(&mut self, loan: Loan<T>, stamp: i64) -> Result<(), StepError> {
        let envelope = Envelope { seq: self.next_seq, stamp, ..Envelope::default() };
        let message = loan
            .into_received(envelope)
            .ok_or_else(|| StepError::contract(format!("{}: a loan that was not made by this run", T::TOPIC)))?;
        self.published.push(Published { message, column: self.column.take() });
        self.next_seq += 1;
        Ok(())
    }

    fn next_seq(&self) -> u64 {
        self.next_seq
    }

    fn skip_to(&mut self, seq: u64) -> bool {
        if self.is_remote {
            self.next_seq = seq;
            self.column = Some(seq);
        }
        true
    }

    fn take_published(&mut self, take: &mut PublishedSink<'_>) -> Result<(), StepError> {
        // More messages would not fit its consumers' queues in a run.
        if self.published.len() > T::QUEUE && !self.is_remote {
            return Err(StepError::contract(format!("{}: more than {} messages in one tick", T::TOPIC, T::QUEUE)));
        }
        for Published { message, column } in self.published.drain(..) {
            let [_, header, rows] = message.parts();
            take(message.envelope(), column, header, rows)?;
        }
        Ok(())
    }

    fn take_messages(&mut self) -> Vec<Received<T>> {
        self.published.drain(..).map(|published| published.message).collect()
    }
}

/// The messages published on the topic of `T` since the last call, if the output keeps them.
pub(crate) fn take_messages<T: Message>(output: &mut dyn AnyOutput) -> Vec<Received<T>> {
    let output: &mut dyn Any = output.as_any();
    output.downcast_mut::<TypedOutput<T>>().map(|output| output.0.take_messages()).unwrap_or_default()
}
