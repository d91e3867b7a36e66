//! A stage at a barrier: its state is saved or loaded.

use super::Runner;
use crate::StepError;
use run::health::Traffic;
use run::state_file::{RunnerState, load_state, write_state};
use std::sync::Arc;

impl Runner<'_> {
    /// Writes the state. A thread syncs it to the disk while the stage continues, and then reports it in the heartbeat.
    pub(super) fn save(&mut self) -> Result<(), StepError> {
        let state = RunnerState {
            tick: self.tick,
            barrier: self.barrier,
            drive_begin: self.drive_begin,
            barrier_time: self.barrier_time,
            inputs: self.inputs.iter().map(|input| (input.topic().to_owned(), input.traffic())).collect(),
            outputs: Self::ticked_outputs(&mut self.outputs).map(|o| (o.topic().to_owned(), o.traffic())).collect(),
            counters: self.outputs.counters.clone(),
            notes: self.outputs.notes.clone(),
            doubts: self.outputs.doubts.clone(),
        };
        let written = {
            let stage = self.stage.save()?;
            write_state(&self.assignment.state_file(self.barrier), &state, stage.pieces(), stage.files())?
        };
        self.saving.begin(written, self.barrier, Arc::clone(&self.ports.waiter.pulse))
    }

    pub(super) fn load(&mut self, barrier: u64) -> Result<(), StepError> {
        let path = self.assignment.state_file(barrier);
        let (state, stage) = load_state(&path)?;
        // A stage without a state can be replaced by any program.
        if !stage.is_empty() {
            self.stage.load(&stage).map_err(|error| error.at(path.display()))?;
        }
        self.tick = state.tick;
        self.barrier = state.barrier;
        self.pulse.update().barrier = state.barrier;
        self.drive_begin = state.drive_begin;
        self.barrier_time = state.barrier_time;
        for output in Self::ticked_outputs(&mut self.outputs) {
            let traffic = state.outputs.get(output.topic()).cloned().unwrap_or_default();
            output.resume(traffic);
        }
        for input in &mut self.inputs {
            if let Some(delivered) = state.inputs.get(input.topic()) {
                input.resume(delivered.clone());
                continue;
            }
            // The replaced program did not read the topic: its producer's state has the number of messages.
            if let Some(channels) = self.assignment.inputs.iter().find(|channels| channels.topic == input.topic()) {
                let (producer, _) = load_state(&self.assignment.producers_state_file(barrier, channels))?;
                let next_seq = producer.outputs.get(input.topic()).map_or(0, |traffic| traffic.next_seq);
                input.resume(Traffic { next_seq, ..Traffic::default() });
            }
        }
        self.outputs.counters = state.counters;
        self.outputs.notes = state.notes;
        self.outputs.doubts = state.doubts;
        self.diagnostics.skip(&self.outputs);
        tracing::debug!(barrier, tick = self.tick, "loaded the saved state");
        Ok(())
    }
}
