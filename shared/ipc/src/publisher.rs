//! The producing end of a channel, by type.

use crate::message::LoanMemory;
use crate::message_type::MessageType;
use crate::slot::SharedLoan;
use crate::untyped_publisher::UntypedPublisher;
use crate::{Channel, IpcError, Loan, Node};
use messages::{Envelope, Message};
use std::marker::PhantomData;

/// Publishes messages of `T`, never more than its slowest consumer has room for.
pub struct Publisher<T: Message> {
    untyped: UntypedPublisher,
    message: PhantomData<T>,
}

impl<T: Message> Publisher<T> {
    /// Opens the channel that the [`crate::ServiceHandles`] created.
    pub fn open(node: &Node, channel: &Channel) -> Result<Self, IpcError> {
        let untyped = UntypedPublisher::open(node, channel, MessageType::of::<T>())?;
        Ok(Self { untyped, message: PhantomData })
    }

    /// Whether all consumers are connected. Earlier messages would be lost.
    pub fn connect(&self) -> Result<bool, IpcError> {
        self.untyped.connect()
    }

    /// Shared memory for a message of at most `capacity` rows.
    pub fn loan(&self, capacity: usize) -> Result<Loan<T>, IpcError> {
        let slot = self.untyped.slot(capacity)?;
        Ok(Loan(LoanMemory::Shared(SharedLoan::new(slot, capacity))))
    }

    /// Whether every consumer has room for `n` more messages.
    pub fn has_room(&mut self, n: u64) -> Result<bool, IpcError> {
        self.untyped.has_room(n)
    }

    /// Messages that the slowest consumer has not taken yet.
    pub fn n_waiting(&mut self) -> Result<u64, IpcError> {
        self.untyped.n_waiting()
    }

    /// Requests a wake of the consumers at the next [`Node::wake_urged`], so that they receive the messages soon.
    pub fn urge(&self) {
        self.untyped.urge();
    }

    /// Sends a loan of [`Publisher::loan`]; a loan in the memory of this process is refused. The caller has checked
    /// [`Publisher::has_room`] since the last message, and calls [`Node::wake_all`] before it sleeps.
    pub fn send(&mut self, loan: Loan<T>, envelope: Envelope) -> Result<(), IpcError> {
        match loan.0 {
            LoanMemory::Shared(loan) => self.untyped.send(loan.finish(envelope), &envelope),
            LoanMemory::Own(_) => {
                let what = format!("publishing {} {}", T::TOPIC, envelope.seq);
                Err(IpcError::transport(what, "the loan is not in shared memory"))
            }
        }
    }
}
