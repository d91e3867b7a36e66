//! The thread that brings a barrier's state to the disk while the stage goes on.

use crate::StepError;
use crate::health::Pulse;
use crate::state::WrittenState;
use std::sync::Arc;
use std::thread::JoinHandle;

/// One state at most is on its way.
#[derive(Default)]
pub(super) struct Saving(Option<JoinHandle<Result<(), StepError>>>);

impl Saving {
    /// Begins; the thread says in the heartbeat that `barrier` is on the disk once it is.
    pub(super) fn begin(&mut self, written: WrittenState, barrier: u64, pulse: Arc<Pulse>) -> Result<(), StepError> {
        self.settle()?;
        let commit = move || {
            written.commit()?;
            pulse.update().barrier = barrier;
            pulse.beat_now();
            Ok(())
        };
        let thread = std::thread::Builder::new().name("saving".to_owned()).spawn(commit);
        self.0 = Some(thread.map_err(StepError::io)?);
        Ok(())
    }

    /// Waits until the last state is on the disk.
    pub(super) fn settle(&mut self) -> Result<(), StepError> {
        let Some(thread) = self.0.take() else { return Ok(()) };
        thread.join().unwrap_or_else(|_| Err(StepError::Io("the thread that saves the state panicked".to_owned())))
    }

    /// Whether it has failed, without waiting.
    pub(super) fn check(&mut self) -> Result<(), StepError> {
        if self.0.as_ref().is_some_and(JoinHandle::is_finished) { self.settle() } else { Ok(()) }
    }
}
