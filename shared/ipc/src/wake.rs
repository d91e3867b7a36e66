//! Sleeping until another process wakes this one.

use crate::domain::service_name;
use crate::opaque::Opaque;
use crate::{Iox, IpcError, Node};
use iceoryx2::port::listener::ListenerWaitError;
use iceoryx2::port::{listener, notifier};
use std::time::Duration;

/// What a process sleeps on. Several calls of [`Waker::wake`] may end one sleep: check every input after waking.
pub struct Wake {
    name: String,
    listener: Opaque<listener::Listener<Iox>>,
}

impl Wake {
    /// Opens the service that the [`crate::ServiceHandles`] created.
    pub fn open(node: &Node, name: &str) -> Result<Self, IpcError> {
        let error = |cause: String| IpcError::transport(format!("wake {name}"), cause);
        let service =
            node.0.service_builder(&service_name(name)?).event().open().map_err(|cause| error(format!("{cause:?}")))?;
        let listener = service.listener_builder().create().map_err(|cause| error(format!("{cause:?}")))?;
        Ok(Self { name: name.to_owned(), listener: Opaque::new(listener) })
    }
    /// Returns when woken (at once if that happened since the last call), on a signal, or after `timeout`.
    pub fn wait(&self, timeout: Duration) -> Result<(), IpcError> {
        match self.listener.timed_wait(|_| {}, timeout) {
            // A signal, or the end of a SIGSTOP: a reason to check every input, too.
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
    /// Opens the service that the [`crate::ServiceHandles`] created.
    pub fn open(node: &Node, name: &str) -> Result<Self, IpcError> {
        let error = |cause: String| IpcError::transport(format!("waker of {name}"), cause);
        let service =
            node.0.service_builder(&service_name(name)?).event().open().map_err(|cause| error(format!("{cause:?}")))?;
        let notifier = service.notifier_builder().create().map_err(|cause| error(format!("{cause:?}")))?;
        Ok(Self { notifier: Opaque::new(notifier) })
    }
    /// Wakes the process. If it has not started yet, or has ended, nothing happens: a process checks every input first.
    pub fn wake(&self) {
        let _not_there = self.notifier.notify();
    }
}
