//! Sleeping until another process wakes this one.

use crate::domain::service_name;
use crate::opaque::Opaque;
use crate::{Iox, IpcError, Node};
use iceoryx2::port::listener::ListenerWaitError;
use iceoryx2::port::{listener, notifier};
use iceoryx2::service::port_factory::event;
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::Duration;

/// The service of a wake, which the [`crate::ServiceHandles`] created.
fn open(node: &Node, name: &str) -> Result<event::PortFactory<Iox>, IpcError> {
    let opened = node.inner.service_builder(&service_name(name)?).event().open();
    opened.map_err(|cause| IpcError::transport(format!("opening wake {name}"), cause))
}

/// What a process sleeps on. Several calls of [`Waker::wake`] may end one sleep: check every input after waking.
pub struct Wake {
    name: String,
    listener: Opaque<listener::Listener<Iox>>,
}

impl Wake {
    /// Opens the service that the [`crate::ServiceHandles`] created.
    pub fn open(node: &Node, name: &str) -> Result<Self, IpcError> {
        let listener = open(node, name)?.listener_builder().create();
        let listener = listener.map_err(|cause| IpcError::transport(format!("wake {name}"), cause))?;
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
        let notifier = open(node, name)?.notifier_builder().create();
        let notifier = notifier.map_err(|cause| IpcError::transport(format!("waker of {name}"), cause))?;
        Ok(Self { notifier: Opaque::new(notifier) })
    }
    /// Wakes the process. If it has not started yet, or has ended, nothing happens: a process checks every input first.
    pub fn wake(&self) {
        let _not_there = self.notifier.notify();
    }
}

/// When a process is to be woken.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Due {
    #[default]
    No,
    /// Before this process sleeps. Until then it may send more.
    BeforeSleep,
    /// As soon as the stage can.
    Now,
}

/// A waker that all ports of a node share: what they send to the same process ends in one wake. A wake costs seven system calls
/// and the start of a core that sleeps; a message in shared memory costs neither.
pub(crate) struct SharedWaker {
    waker: Waker,
    due: Cell<Due>,
}

impl SharedWaker {
    /// The process has something to check, before this one sleeps.
    pub(crate) fn request(&self) {
        self.due.set(self.due.get().max(Due::BeforeSleep));
    }

    /// The process has something to check now.
    pub(crate) fn urge(&self) {
        self.due.set(Due::Now);
    }
}

/// The shared wakers of a node, by the names of their services.
#[derive(Default)]
pub(crate) struct SharedWakers(RefCell<BTreeMap<String, Rc<SharedWaker>>>);

impl SharedWakers {
    fn wake(&self, least: Due) {
        for waker in self.0.borrow().values().filter(|waker| waker.due.get() >= least) {
            waker.due.set(Due::No);
            waker.waker.wake();
        }
    }
}

impl Node {
    /// The waker of the process that sleeps on the [`Wake`] of this name.
    pub(crate) fn shared_waker(&self, name: &str) -> Result<Rc<SharedWaker>, IpcError> {
        if let Some(waker) = self.wakers.0.borrow().get(name) {
            return Ok(Rc::clone(waker));
        }
        let waker = Rc::new(SharedWaker { waker: Waker::open(self, name)?, due: Cell::default() });
        self.wakers.0.borrow_mut().insert(name.to_owned(), Rc::clone(&waker));
        Ok(waker)
    }

    /// Wakes each process to which this node has sent a message since its last wake, or from which it has taken one. Always call
    /// it before you sleep.
    pub fn wake_all(&self) {
        self.wakers.wake(Due::BeforeSleep);
    }

    /// Wakes those that should not wait until this process sleeps: consumers after [`crate::Publisher::urge`], and producers for
    /// which half of a queue has become free.
    pub fn wake_urged(&self) {
        self.wakers.wake(Due::Now);
    }
}
