//! The thread that syncs a barrier's state to the disk while the stage continues.

use crate::StepError;
use run::health::Pulse;
use run::state_file::WrittenState;
use std::sync::Arc;
use std::thread::JoinHandle;

/// Saves at most one state at a time.
#[derive(Default)]
pub(super) struct Saving(Option<JoinHandle<Result<(), StepError>>>);

impl Saving {
    /// Starts the thread, which reports `barrier` in the heartbeat once the state is on the disk.
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
        thread.join().unwrap_or_else(|_| Err(StepError::io("the thread that saves the state panicked")))
    }

    /// Whether saving has failed, without waiting.
    pub(super) fn check(&mut self) -> Result<(), StepError> {
        if self.0.as_ref().is_some_and(JoinHandle::is_finished) { self.settle() } else { Ok(()) }
    }
}
