//! The reports of a stage as `tracing` events.
//!
//! A step has no clock and logs nothing: it adds notes and counters to its [`Outputs`]. The runner turns them into
//! events after the step. The events have the time of the tick; the time stamp of the log line is set by the runner.

use crate::Outputs;

/// The notes that have been logged.
#[derive(Default)]
pub(crate) struct Diagnostics {
    n_notes: usize,
}

impl Diagnostics {
    /// Skips the notes of a saved state, which the previous process has logged.
    pub(crate) fn skip(&mut self, outputs: &Outputs) {
        self.n_notes = outputs.notes.len();
    }

    /// Logs the notes that `tick` has added.
    pub(crate) fn log_notes(&mut self, outputs: &Outputs, tick: u64) {
        for note in outputs.notes.iter().skip(self.n_notes) {
            tracing::info!(tick, "{note}");
        }
        self.n_notes = outputs.notes.len();
    }

    /// Logs the counters up to `tick`.
    pub(crate) fn log_counters(outputs: &Outputs, tick: u64) {
        for (counter, count) in &outputs.counters {
            tracing::debug!(tick, counter, count, "counter");
        }
    }
}
