//! Sleeping until there is something to do.

use crate::domain::service_name;
use crate::{Iox, IpcError, Node};
use iceoryx2::port::listener::ListenerWaitError;
use iceoryx2::port::{listener, notifier};
use std::time::Duration;

/// What a process sleeps on. Rings coalesce: after waking, look at everything.
pub struct Wake {
    name: String,
    listener: listener::Listener<Iox>,
}

impl Wake {
    /// Opens the service that the [`crate::Keeper`] made.
    pub fn open(node: &Node, name: &str) -> Result<Self, IpcError> {
        let error = |cause: String| IpcError::transport(format!("wake {name}"), cause);
        let service =
            node.0.service_builder(&service_name(name)?).event().open().map_err(|cause| error(format!("{cause:?}")))?;
        let listener = service.listener_builder().create().map_err(|cause| error(format!("{cause:?}")))?;
        Ok(Self { name: name.to_owned(), listener })
    }
    /// Returns on a ring, at once if there was one since the last call, on a signal, or after `timeout`.
    pub fn wait(&self, timeout: Duration) -> Result<(), IpcError> {
        match self.listener.timed_wait(|_| {}, timeout) {
            // A signal, or the end of a SIGSTOP: a reason to look like any other.
            Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
            Err(cause) => Err(IpcError::transport(format!("waiting on {}", self.name), cause)),
        }
    }
}

/// Rings somebody's [`Wake`].
pub struct Waker {
    notifier: notifier::Notifier<Iox>,
}

impl Waker {
    /// Opens the service that the [`crate::Keeper`] made.
    pub fn open(node: &Node, name: &str) -> Result<Self, IpcError> {
        let error = |cause: String| IpcError::transport(format!("waker of {name}"), cause);
        let service =
            node.0.service_builder(&service_name(name)?).event().open().map_err(|cause| error(format!("{cause:?}")))?;
        let notifier = service.notifier_builder().create().map_err(|cause| error(format!("{cause:?}")))?;
        Ok(Self { notifier })
    }
    /// Rings. That nobody sleeps there (yet, or any more) is no error: who comes looks at everything first.
    pub fn ring(&self) {
        let _nobody_there = self.notifier.notify();
    }
}
