//! The producing end of a topic, by type.

use super::context::PortContext;
use super::untyped_output::UntypedOutput;
use crate::StepError;
use crate::outputs::{AnyOutput, Output, TickedOutput, TypedOutput};
use ipc::{Loan, Publisher};
use messages::{Message, TickRow};
use run::assignment::TopicChannels;
use run::health::Traffic;
use std::rc::Rc;

/// The producing end of a topic.
struct SharedOutput<T: Message> {
    messages: Publisher<T>,
    untyped: UntypedOutput,
}

pub(crate) fn shared_output<T: Message>(
    context: &PortContext,
    channels: &TopicChannels,
) -> Result<Box<dyn AnyOutput>, StepError> {
    let messages = Publisher::<T>::open(&context.node, &channels.messages)?;
    let untyped = UntypedOutput::open(context, channels, T::QUEUE)?;
    Ok(Box::new(TypedOutput::<T>(Box::new(SharedOutput { messages, untyped }))))
}

impl<T: Message> Output<T> for SharedOutput<T> {
    fn loan(&self, capacity: usize) -> Result<Loan<T>, StepError> {
        Ok(self.untyped.waiter().transporting(|| self.messages.loan(capacity))?)
    }
    fn publish(&mut self, loan: Loan<T>, stamp: i64) -> Result<(), StepError> {
        let waiter = Rc::clone(self.untyped.waiter());
        waiter.transporting(|| {
            let rows = loan.rows();
            let envelope = self.untyped.next(&mut self.messages, rows.len(), size_of_val(rows), stamp)?;
            let sent = self.messages.send(loan, envelope);
            self.untyped.sent(sent)
        })
    }
    fn next_seq(&self) -> u64 {
        self.untyped.next_seq()
    }
    fn skip_to(&mut self, seq: u64) -> bool {
        self.untyped.skip_to(seq)
    }
    fn ticked(&mut self) -> Option<&mut dyn TickedOutput> {
        Some(self)
    }
}

impl<T: Message> TickedOutput for SharedOutput<T> {
    fn topic(&self) -> &str {
        self.untyped.topic()
    }
    fn connect(&self) -> Result<bool, StepError> {
        Ok(self.messages.connect()? & self.untyped.connect()?)
    }
    fn publish_tick(&mut self, row: TickRow) -> Result<(), StepError> {
        self.untyped.publish_tick(row)
    }
    fn is_drained(&mut self) -> Result<bool, StepError> {
        self.untyped.is_drained(&mut self.messages)
    }
    fn resume(&mut self, published: Traffic) {
        self.untyped.resume(published);
    }
    fn traffic(&self) -> Traffic {
        self.untyped.traffic()
    }
    fn note_waiting(&mut self) -> Result<(), StepError> {
        self.untyped.note_waiting(&mut self.messages)
    }
}
