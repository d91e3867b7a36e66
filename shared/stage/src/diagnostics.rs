//! What a stage reports, as `tracing` events.
//!
//! A step has no clock and logs nothing: it adds notes and counters to its [`Outputs`]. The runner turns them into events
//! after the step. Their time is the tick; the time stamp of the log line is that of the runner.

use crate::Outputs;

/// Remembers what has been logged.
#[derive(Default)]
pub(crate) struct Diagnostics {
    n_notes: usize,
}

impl Diagnostics {
    /// Notes of a saved state have been logged by the process before this one.
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
