//! The inputs of a step.

use crate::StepError;
use ipc::Received;
use messages::Message;
use std::any::Any;
use std::collections::BTreeMap;

/// All messages of one tick.
#[derive(Default)]
pub struct Inputs {
    by_topic: BTreeMap<&'static str, Box<dyn Any>>,
}

impl Inputs {
    /// The tick's messages of `T` in the order they were published; empty after the first call.
    pub fn take<T: Message>(&mut self) -> Vec<Received<T>> {
        self.take_named(T::TOPIC)
    }
    /// [`Inputs::take`] for a port whose name differs from its type: see [`Port::named`](crate::Port::named).
    pub fn take_named<T: Message>(&mut self, port: &str) -> Vec<Received<T>> {
        self.by_topic
            .get_mut(port)
            .and_then(|messages| messages.downcast_mut::<Vec<Received<T>>>())
            .map(std::mem::take)
            .unwrap_or_default()
    }
    pub(crate) fn push<T: Message>(&mut self, port: &'static str, message: Received<T>) {
        let messages = self.by_topic.entry(port).or_insert_with(|| Box::new(Vec::<Received<T>>::new()));
        if let Some(messages) = messages.downcast_mut::<Vec<Received<T>>>() {
            messages.push(message);
        }
    }
    /// The first message of a port, which stays in the inputs.
    pub(crate) fn first<T: Message>(&self, port: &str) -> Option<&Received<T>> {
        self.by_topic.get(port)?.downcast_ref::<Vec<Received<T>>>()?.first()
    }
    pub(crate) fn is_empty(&self) -> bool {
        self.by_topic.is_empty()
    }
}

/// Adds a message that was kept as bytes to the inputs.
pub(crate) fn push_bytes<T: Message>(inputs: &mut Inputs, port: &'static str, bytes: &[u8]) -> Result<(), StepError> {
    inputs.push::<T>(port, Received::from_bytes(bytes)?);
    Ok(())
}
