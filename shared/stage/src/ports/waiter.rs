//! Sleeping until something comes, with the heartbeat saying what for.

use crate::StepError;
use crate::health::{Activity, Pulse};
use crate::process::{monotonic_nanos, thread_cpu_nanos};
use ipc::{IpcError, Wake};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How long a sleeper trusts its wake before it looks by itself: bounds the reaction to a stop, and to a lost ring.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// The same while a run starts: nobody rings for having come, and a start should not take long.
const LOOK_AGAIN_AT_START: Duration = Duration::from_millis(10);

/// A consumer that is gone is the supervisor's to report, with that one's own last words; it has this long to end the run, also on a
/// busy machine, before the loss itself is reported.
const LOSS_PATIENCE: Duration = Duration::from_secs(30);

/// Sleeping and stopping, shared by all ports of a stage.
pub(crate) struct Waiter {
    pub(crate) wake: Wake,
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) pulse: Arc<Pulse>,
    /// Time slept so far: a step that waits for room at a consumer is not at work.
    pub(crate) slept_nanos: Cell<u64>,
    /// CPU time so far for lending, sending, waiting and receiving.
    pub(crate) transport_nanos: Cell<u64>,
}

impl Waiter {
    /// Does `work` and puts its CPU time down to the transport. Not to be nested.
    pub(crate) fn transporting<R>(&self, work: impl FnOnce() -> R) -> R {
        let begun = thread_cpu_nanos();
        let result = work();
        self.transport_nanos.set(self.transport_nanos.get() + thread_cpu_nanos() - begun);
        result
    }

    /// Sleeps until `done`, with the heartbeat saying `activity` meanwhile. `false` if the run is being stopped.
    pub(crate) fn wait_until(
        &self,
        activity: impl Fn() -> Activity,
        mut done: impl FnMut() -> Result<bool, StepError>,
    ) -> Result<bool, StepError> {
        let mut said = None;
        while !done()? {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            let now = activity();
            let starting = matches!(now, Activity::Connecting(_) | Activity::Ready);
            if said.as_ref() != Some(&now) {
                self.pulse.set(now.clone());
                said = Some(now);
            }
            let begun = monotonic_nanos();
            self.wake.wait(if starting { LOOK_AGAIN_AT_START } else { LOOK_AGAIN })?;
            self.slept_nanos.set(self.slept_nanos.get() + monotonic_nanos() - begun);
        }
        Ok(true)
    }

    /// What a failed send comes to: an error at once, or, if a consumer is gone, after [`LOSS_PATIENCE`].
    pub(super) fn failed_send(&self, topic: &'static str, error: IpcError) -> StepError {
        if !matches!(error, IpcError::Lost { .. }) {
            return error.into();
        }
        let deadline = monotonic_nanos() + LOSS_PATIENCE.as_nanos() as u64;
        let patience = || Ok(monotonic_nanos() > deadline);
        match self.wait_until(|| Activity::Blocked(topic.to_owned()), patience) {
            Ok(true) => error.into(),
            Ok(false) => StepError::Stopped { topic },
            Err(other) => other,
        }
    }
}
