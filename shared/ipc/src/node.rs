//! A process's membership in a domain: the parent of its ports, and the wakers that the ports share.

use crate::domain::Domain;
use crate::opaque::Opaque;
use crate::ownership::create_private_folder;
use crate::wake::{Wake, Waker};
use crate::{Iox, IpcError};
use iceoryx2::prelude::*;
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::path::Path as StdPath;
use std::rc::Rc;

/// A node of a domain: creates ports, and wakes the processes at their other ends.
pub struct Node {
    // Dropped before the node, which must outlive its ports.
    pub(crate) wakers: SharedWakers,
    pub(crate) inner: Opaque<iceoryx2::prelude::Node<Iox>>,
    pub(crate) domain: Domain,
}

impl Domain {
    /// A node of the domain. Its ports belong to the calling thread.
    pub fn node(&self, name: &str) -> Result<Node, IpcError> {
        // Problems are returned as errors; IOX2_LOG_LEVEL shows iceoryx2's own log for debugging.
        set_log_level_from_env_or(LogLevel::Fatal);
        let root = self.root();
        create_private_folder(&root).map_err(|error| IpcError::Folder { folder: root.clone(), cause: error })?;
        self.node_inside(&root, name)
    }

    /// A node of a domain whose folder exists. The superuser may join the runs of other users.
    pub(crate) fn node_inside(&self, root: &StdPath, name: &str) -> Result<Node, IpcError> {
        let what = || format!("node {name} of domain {}", self.name());
        let mut config = Config::default();
        config.global.prefix = self.prefix().as_str().try_into().map_err(|cause| IpcError::transport(what(), cause))?;
        let root: Path =
            root.to_string_lossy().as_ref().try_into().map_err(|cause| IpcError::transport(what(), cause))?;
        config.global.set_root_path(&root);
        // The supervisor cleans up after killed processes: it wipes the whole domain.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        let node_name: NodeName = name.try_into().map_err(|cause| IpcError::transport(what(), cause))?;
        let node = NodeBuilder::new()
            .name(&node_name)
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Iox>()
            .map_err(|cause| IpcError::transport(what(), cause))?;
        self.close_to_others()?;
        Ok(Node { wakers: SharedWakers::default(), inner: Opaque::new(node), domain: self.clone() })
    }
}

impl Node {
    /// Removes the ports of processes that have ended, so that no producer waits for their acknowledgements. `false` if
    /// this is not possible yet, because a process is creating a port or was killed while creating one, or because
    /// shared memory cannot be read.
    pub fn remove_dead_ports(&self) -> bool {
        if self.domain.has_unfinished_files().unwrap_or(true) {
            return false;
        }
        // Nodes that another process is cleaning up, or that cannot be cleaned yet, are left to the next call.
        let _state = self.inner.try_cleanup_dead_nodes();
        true
    }

    /// The wake on which a process sleeps. The [`crate::ServiceHandles`] created the service of this name.
    pub fn open_wake(&self, name: &str) -> Result<Wake, IpcError> {
        Wake::open(&self.inner, name)
    }

    /// Wakes the process that sleeps on the [`Wake`] of this name. The [`crate::ServiceHandles`] created its service.
    pub fn open_waker(&self, name: &str) -> Result<Waker, IpcError> {
        Waker::open(&self.inner, name)
    }

    /// The waker of the process that sleeps on the [`Wake`] of this name.
    pub(crate) fn shared_waker(&self, name: &str) -> Result<Rc<SharedWaker>, IpcError> {
        if let Some(waker) = self.wakers.0.borrow().get(name) {
            return Ok(Rc::clone(waker));
        }
        let waker = Rc::new(SharedWaker { waker: self.open_waker(name)?, due: Cell::default() });
        self.wakers.0.borrow_mut().insert(name.to_owned(), Rc::clone(&waker));
        Ok(waker)
    }

    /// Wakes each process to which this node has sent a message since its last wake, or from which it has taken one. Always call
    /// it before you sleep.
    pub fn wake_all(&self) {
        self.wakers.wake(Due::BeforeSleep);
    }

    /// Wakes the processes that should not wait until this process sleeps: consumers after [`crate::Publisher::urge`],
    /// and producers for which half of a queue has become free.
    pub fn wake_urged(&self) {
        self.wakers.wake(Due::Now);
    }
}

/// Time at which a process is to be woken.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Due {
    #[default]
    No,
    /// Before this process sleeps. Until then it may send more.
    BeforeSleep,
    /// Once the stage can wake it.
    Now,
}

/// A waker that all ports of a node share: messages to the same process cause only one wake. A wake costs seven system
/// calls and the start of a sleeping core; a message in shared memory costs neither.
pub(crate) struct SharedWaker {
    waker: Waker,
    due: Cell<Due>,
}

impl SharedWaker {
    /// Requests a wake of the process before this one sleeps.
    pub(crate) fn request(&self) {
        self.due.set(self.due.get().max(Due::BeforeSleep));
    }

    /// Requests a wake of the process now.
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
