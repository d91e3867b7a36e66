//! An output that keeps its messages, for tests and for a stage that runs alone.

use crate::StepError;
use crate::outputs::{AnyOutput, Output, PublishedSink, TypedOutput};
use ipc::{Loan, Received};
use messages::{Envelope, Message};
use std::any::Any;

/// The messages that were published on the topic of `T`.
pub(crate) struct MemoryOutput<T: Message> {
    next_seq: u64,
    published: Vec<Received<T>>,
}

pub(crate) fn memory_output<T: Message>() -> Box<dyn AnyOutput> {
    Box::new(TypedOutput::<T>(Box::new(MemoryOutput::<T> { next_seq: 0, published: Vec::new() })))
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
        self.published.push(message);
        self.next_seq += 1;
        Ok(())
    }

    fn next_seq(&self) -> u64 {
        self.next_seq
    }

    fn take_published(&mut self, take: &mut PublishedSink<'_>) -> Result<(), StepError> {
        // More would not fit its consumers' queues in a run.
        if self.published.len() > T::QUEUE {
            return Err(StepError::contract(format!("{}: more than {} messages in one tick", T::TOPIC, T::QUEUE)));
        }
        for message in self.published.drain(..) {
            let [_, header, rows] = message.parts();
            take(message.envelope(), header, rows)?;
        }
        Ok(())
    }

    fn take_messages(&mut self) -> Vec<Received<T>> {
        std::mem::take(&mut self.published)
    }
}

/// The messages published on the topic of `T` since the last call, if the output keeps them.
pub(crate) fn take_messages<T: Message>(output: &mut dyn AnyOutput) -> Vec<Received<T>> {
    let output: &mut dyn Any = output.as_any();
    output.downcast_mut::<TypedOutput<T>>().map(|output| output.0.take_messages()).unwrap_or_default()
}
