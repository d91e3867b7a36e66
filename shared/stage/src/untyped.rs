//! Messages as bytes, for stages that get their topics only at run time: stages in other languages, and `replay`.
//!
//! [`Port::all`](crate::Port::all) has the topics by name; their [`ByteTable`](crate::messages::ByteTable)s describe header and rows.

use crate::{Inputs, Loan, Outputs, Received, StepError};
use messages::pod::{bytes_from_rows, bytes_from_rows_mut};
use messages::{Envelope, Message};

/// A [`Received`] without its type. Its memory stays where it is until it is dropped.
pub trait UntypedMessage {
    /// See [`Received::envelope`].
    fn envelope(&self) -> &Envelope;
    /// Bytes of the fixed part, in place.
    fn header(&self) -> &[u8];
    /// Bytes of the rows, in place.
    fn rows(&self) -> &[u8];
}

impl<T: Message> UntypedMessage for Received<T> {
    fn envelope(&self) -> &Envelope {
        Received::envelope(self)
    }
    fn header(&self) -> &[u8] {
        bytes_from_rows(std::slice::from_ref(Received::header(self)))
    }
    fn rows(&self) -> &[u8] {
        bytes_from_rows(Received::rows(self))
    }
}

/// A [`Loan`] without its type: all of its rows are in use. Its memory stays where it is until it is published or dropped.
pub trait UntypedLoan {
    /// Bytes of the fixed part, zero at first.
    fn header_mut(&mut self) -> &mut [u8];
    /// Bytes of the rows, zero at first.
    fn rows_mut(&mut self) -> &mut [u8];
    /// Publishes as [`Outputs::publish_column`] of submap `column`; without `column`, as [`Outputs::publish`].
    fn publish(self: Box<Self>, outputs: &mut Outputs, stamp: i64, column: Option<u64>) -> Result<(), StepError>;
}

impl<T: Message> UntypedLoan for Loan<T> {
    fn header_mut(&mut self) -> &mut [u8] {
        bytes_from_rows_mut(std::slice::from_mut(Loan::header_mut(self)))
    }
    fn rows_mut(&mut self) -> &mut [u8] {
        bytes_from_rows_mut(Loan::rows_mut(self))
    }
    fn publish(self: Box<Self>, outputs: &mut Outputs, stamp: i64, column: Option<u64>) -> Result<(), StepError> {
        match column {
            Some(seq) => outputs.publish_column(*self, stamp, seq),
            None => outputs.publish(*self, stamp),
        }
    }
}

/// The type of [`first`] for one message type.
pub(crate) type FirstMaker = for<'a> fn(&'a Inputs, &str) -> Option<&'a dyn UntypedMessage>;

pub(crate) fn first<'a, T: Message>(inputs: &'a Inputs, port: &str) -> Option<&'a dyn UntypedMessage> {
    inputs.first::<T>(port).map(|message| message as &dyn UntypedMessage)
}

/// The type of [`loan`] for one message type.
pub(crate) type LoanMaker = fn(&mut Outputs, usize) -> Result<Box<dyn UntypedLoan>, StepError>;

pub(crate) fn take<T: Message>(inputs: &mut Inputs, port: &str) -> Vec<Box<dyn UntypedMessage>> {
    inputs.take_named::<T>(port).into_iter().map(|message| Box::new(message) as Box<dyn UntypedMessage>).collect()
}

pub(crate) fn publish_bytes<T: Message>(outputs: &mut Outputs, port: &str, bytes: &[u8]) -> Result<(), StepError> {
    let message = Received::<T>::from_bytes(bytes)?;
    let mut loan = outputs.output::<T>(port)?.loan(message.rows().len())?;
    *loan.header_mut() = *message.header();
    loan.extend_from_slice(message.rows())?;
    outputs.publish_on(port, loan, message.stamp(), None)
}

pub(crate) fn loan<T: Message>(outputs: &mut Outputs, n_rows: usize) -> Result<Box<dyn UntypedLoan>, StepError> {
    let mut loan = outputs.loan::<T>(n_rows)?;
    loan.grow(n_rows)?;
    Ok(Box::new(loan))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Port;
    use crate::memory_output::{memory_output, take_messages};
    use messages::{ClassRow, ClassTopic};

    #[test]
    fn bytes_written_through_an_untyped_loan_are_the_rows_of_the_message() {
        let port = Port::all().into_iter().find(|port| port.topic() == "class").expect("a topic");
        let mut outputs = Outputs::default();
        outputs.by_topic.insert(ClassTopic::TOPIC, memory_output::<ClassTopic>());
        let mut loan = outputs.loan_untyped(&port, 2).expect("a loan");
        assert_eq!(loan.rows_mut(), [0; 4]);
        loan.rows_mut().copy_from_slice(&[7, 128, 9, 64]);
        loan.header_mut()[8] = 5;
        loan.publish(&mut outputs, 11, Some(0)).expect("the first column");
        let output = outputs.by_topic.get_mut(ClassTopic::TOPIC).expect("an output");
        let messages = take_messages::<ClassTopic>(&mut **output);
        assert_eq!(messages[0].rows(), [ClassRow { class_id: 7, score: 128 }, ClassRow { class_id: 9, score: 64 }]);
        assert_eq!((messages[0].stamp(), messages[0].header().model_digest), (11, 5));
        let message: &dyn UntypedMessage = &messages[0];
        assert_eq!((message.rows(), message.header()[8], message.envelope().len), (&[7, 128, 9, 64][..], 5, 2));
    }
}
