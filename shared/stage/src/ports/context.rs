//! State that all ports of a stage share.

use super::waiter::Waiter;
use ipc::Node;
use std::cell::Cell;
use std::rc::Rc;

/// The tick that a stage is in.
#[derive(Default)]
pub(crate) struct Clock {
    pub(crate) tick: Cell<u64>,
    pub(crate) born_nanos: Cell<u64>,
}

/// State that all ports of a stage share.
#[derive(Clone)]
pub(crate) struct PortContext {
    pub(crate) node: Rc<Node>,
    pub(crate) waiter: Rc<Waiter>,
    pub(crate) clock: Rc<Clock>,
}
