//! A stage in live mode: steps over all messages that have arrived, and a process that replaces one that has failed.

use super::Runner;
use crate::ports::next_number;
use crate::{Inputs, StepError};
use messages::TickRow;
use run::assignment::Restart;
use run::health::Activity;
use run::process::monotonic_nanos;
use std::cell::Cell;

impl Runner<'_> {
    /// Live: a step over all messages that have arrived, as soon as there is a new one.
    pub(super) fn live_tick(&mut self) -> Result<Option<bool>, StepError> {
        let inputs = &mut self.inputs;
        let saving = &mut self.saving;
        let n_ticks = self.tick;
        let news = Cell::new(None);
        let here = self.ports.waiter.wait_until(
            || Activity::Waiting("any".to_owned()),
            || {
                saving.check()?;
                let mut newest: Option<TickRow> = None;
                let mut barrier = 0;
                let mut has_messages = false;
                let mut all_ended = true;
                for input in inputs.iter_mut() {
                    let found = input.gather_newest()?;
                    barrier = barrier.max(found.barrier);
                    has_messages |= found.has_messages;
                    all_ended &= found.row.is_some_and(|row| row.end != 0);
                    newest = found.row.into_iter().chain(newest).max_by_key(|row| row.tick);
                }
                let Some(row) = newest else { return Ok(false) };
                let is_new = has_messages || barrier > 0 || all_ended || row.tick >= n_ticks;
                news.set(Some(TickRow { barrier, end: u32::from(all_ended), ..row }));
                Ok(is_new)
            },
        )?;
        let Some(mut row) = news.get().filter(|_| here) else { return Ok(None) };
        let _span = tracing::debug_span!("tick", tick = row.tick).entered();
        // Several inputs report the same barrier.
        row.barrier = if row.barrier > self.barrier { row.barrier } else { 0 };
        let mut inputs = Inputs::default();
        for input in &mut self.inputs {
            input.deliver_all(&mut inputs);
        }
        let has_input = self.work(&row, inputs)?;
        self.tick = row.tick;
        self.complete(row)?;
        if has_input {
            self.ages.add(monotonic_nanos().saturating_sub(row.born_nanos));
        }
        Ok(Some(row.end != 0))
    }

    /// Replaces a process that has failed: counts continue, and no number is used twice.
    pub(super) fn follow(&mut self, restart: &Restart) {
        self.tick = next_number(restart.ticks, restart.epoch);
        for input in &mut self.inputs {
            input.resume(restart.inputs.get(input.topic()).cloned().unwrap_or_default());
        }
        for output in Self::ticked_outputs(&mut self.outputs) {
            let mut published = restart.outputs.get(output.topic()).cloned().unwrap_or_default();
            published.epoch = restart.epoch;
            output.resume(published);
        }
    }
}
