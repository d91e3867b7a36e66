//! Sleeping until a message arrives or a consumer has room; the heartbeat reports the reason.

use crate::StepError;
use ipc::{IpcError, Node, Wake};
use run::health::{Activity, Pulse};
use run::process::{monotonic_nanos, thread_cpu_nanos};
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Longest sleep before the condition is checked again: bounds the reaction to a stop, and to a lost wake.
const POLL: Duration = Duration::from_millis(100);

/// Longest sleep while a run starts: a process that has started wakes no other, and a start must be quick.
const POLL_AT_START: Duration = Duration::from_millis(10);

/// When a consumer has ended, the supervisor reports it with its last log lines. It has this long to end the run, even
/// on a busy machine, before the stage reports the lost message.
const LOSS_GRACE: Duration = Duration::from_secs(30);

/// Sleeping and stopping, shared by all ports of a stage.
pub(crate) struct Waiter {
    pub(crate) wake: Wake,
    pub(crate) node: Rc<Node>,
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) pulse: Arc<Pulse>,
    /// Time slept so far. Waiting for room at a consumer does not count as work of a step.
    pub(crate) slept_nanos: Cell<u64>,
    /// Time slept so far by reason, named as in [`Activity`].
    waits: RefCell<BTreeMap<String, u64>>,
    /// CPU time so far for loans, sending, waiting and receiving.
    pub(crate) transport_nanos: Cell<u64>,
}

impl Waiter {
    pub(crate) fn new(node: Rc<Node>, wake: Wake, stop: Arc<AtomicBool>, pulse: Arc<Pulse>) -> Self {
        let (slept_nanos, waits, transport_nanos) = Default::default();
        Self { wake, node, stop, pulse, slept_nanos, waits, transport_nanos }
    }

    /// Does `work` and counts its CPU time as transport. Must not be nested.
    pub(crate) fn transporting<R>(&self, work: impl FnOnce() -> R) -> R {
        let begun = thread_cpu_nanos();
        let result = work();
        self.transport_nanos.set(self.transport_nanos.get() + thread_cpu_nanos() - begun);
        result
    }

    /// Counts time in which the stage's thread ran no step.
    pub(crate) fn count_wait(&self, activity: &Activity, nanos: u64) {
        *self.waits.borrow_mut().entry(activity.to_string()).or_default() += nanos;
    }

    /// Seconds slept so far, by reason.
    pub(crate) fn waits(&self) -> BTreeMap<String, f64> {
        self.waits.borrow().iter().map(|(reason, nanos)| (reason.clone(), *nanos as f64 * 1e-9)).collect()
    }

    /// Sleeps until `done`; the heartbeat reports `activity` meanwhile. `false` if the run is being stopped.
    pub(crate) fn wait_until(
        &self,
        activity: impl Fn() -> Activity,
        mut done: impl FnMut() -> Result<bool, StepError>,
    ) -> Result<bool, StepError> {
        let mut reported = None;
        while !done()? {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            let now = activity();
            let starting = matches!(now, Activity::Connecting(_) | Activity::Ready);
            if reported.as_ref() != Some(&now) {
                self.pulse.set(now.clone());
                reported = Some(now.clone());
            }
            self.node.wake_all();
            let begun = monotonic_nanos();
            self.wake.wait(if starting { POLL_AT_START } else { POLL })?;
            let slept = monotonic_nanos() - begun;
            self.slept_nanos.set(self.slept_nanos.get() + slept);
            self.count_wait(&now, slept);
        }
        Ok(true)
    }

    /// The result of a failed send: an error at once or, if a consumer has ended, after [`LOSS_GRACE`].
    pub(super) fn failed_send(&self, topic: &str, error: IpcError) -> StepError {
        if !matches!(error, IpcError::Lost { .. }) {
            return error.into();
        }
        let deadline = monotonic_nanos() + LOSS_GRACE.as_nanos() as u64;
        let is_over = || Ok(monotonic_nanos() > deadline);
        match self.wait_until(|| Activity::Blocked(topic.to_owned()), is_over) {
            Ok(true) => error.into(),
            Ok(false) => StepError::Stopped { topic: topic.to_owned() },
            Err(other) => other,
        }
    }
}
