//! Sleeps until another process wakes this one.

use crate::domain::service_name;
use crate::opaque::Opaque;
use crate::{Iox, IpcError};
use iceoryx2::port::listener::ListenerWaitError;
use iceoryx2::port::{listener, notifier};
use iceoryx2::prelude::Node;
use iceoryx2::service::port_factory::event;
use std::time::Duration;

/// The service of a wake, which the [`crate::ServiceHandles`] created.
fn open(node: &Node<Iox>, name: &str) -> Result<event::PortFactory<Iox>, IpcError> {
    let opened = node.service_builder(&service_name(name)?).event().open();
    opened.map_err(|cause| IpcError::transport(format!("opening wake {name}"), cause))
}

/// The wake on which a process sleeps. Several calls of [`Waker::wake`] may end one sleep: check every input after
/// waking.
pub struct Wake {
    name: String,
    listener: Opaque<listener::Listener<Iox>>,
}

impl Wake {
    pub(crate) fn open(node: &Node<Iox>, name: &str) -> Result<Self, IpcError> {
        let listener = open(node, name)?.listener_builder().create();
        let listener = listener.map_err(|cause| IpcError::transport(format!("wake {name}"), cause))?;
        Ok(Self { name: name.to_owned(), listener: Opaque::new(listener) })
    }
    /// Returns when woken (at once if that happened since the last call), on a signal, or after `timeout`.
    pub fn wait(&self, timeout: Duration) -> Result<(), IpcError> {
        match self.listener.timed_wait(|_| {}, timeout) {
            // A signal, or the end of a SIGSTOP, is also a reason to check every input.
            Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
            Err(cause) => Err(IpcError::transport(format!("waiting on {}", self.name), cause)),
        }
    }
}

/// Wakes the process that sleeps on a [`Wake`].
pub struct Waker {
    notifier: Opaque<notifier::Notifier<Iox>>,
}

impl Waker {
    pub(crate) fn open(node: &Node<Iox>, name: &str) -> Result<Self, IpcError> {
        let notifier = open(node, name)?.notifier_builder().create();
        let notifier = notifier.map_err(|cause| IpcError::transport(format!("waker of {name}"), cause))?;
        Ok(Self { notifier: Opaque::new(notifier) })
    }
    /// Wakes the process. Has no effect before its start or after its end: a process checks every input first.
    pub fn wake(&self) {
        let _not_there = self.notifier.notify();
    }
}
