//! A source: it sets barriers and the end on request of the supervisor, and publishes them to all stages.

use super::{Runner, read_command};
use crate::{Flow, Inputs, Mode, StepError};
use messages::{NO_DRIVE_TIME, TickRow};
use run::health::Activity;
use run::process::monotonic_nanos;
use std::sync::atomic::Ordering;

impl Runner<'_> {
    /// Runs one tick of a source. `Some(true)`: the last one. `None`: the run is being stopped.
    pub(super) fn source_tick(&mut self) -> Result<Option<bool>, StepError> {
        if self.ports.waiter.stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        read_command(&self.control, &mut self.command)?;
        if !self.wait_for_lease()? {
            return Ok(None);
        }
        let _span = tracing::debug_span!("tick", tick = self.tick).entered();
        let born = monotonic_nanos();
        self.ports.clock.tick.set(self.tick);
        self.ports.clock.born_nanos.set(born);
        self.pulse.set(Activity::Working);
        let flow = self.timed_step(&mut Inputs::default())?;
        let end = flow == Flow::End || self.command.drain;
        if self.command.drain && flow == Flow::Continue {
            // A live source always ends on request.
            if self.assignment.context.mode == Mode::Offline {
                self.outputs.note("drained on request: the rest of the drive was not read");
            }
            self.pulse.update().drained = true;
        }
        let drive_time = self.outputs.drive_time.unwrap_or(NO_DRIVE_TIME);
        if drive_time != NO_DRIVE_TIME && self.barrier_time.is_none_or(|since| since > drive_time) {
            // The first data, or a jump back of a sensor's clock.
            self.barrier_time = Some(drive_time);
        }
        let since = self.barrier_time.unwrap_or(drive_time);
        let pause = self.command.pause && !end;
        let is_time = drive_time.saturating_sub(since) as f64 >= self.assignment.barrier_s * 1e9;
        let barrier_due = pause || is_time && !end;
        let row = TickRow {
            tick: self.tick,
            barrier: if barrier_due { self.barrier + 1 } else { 0 },
            drive_time,
            born_nanos: born,
            progress: self.outputs.progress.unwrap_or_default() as f32,
            end: u32::from(end),
            ..TickRow::default()
        };
        self.complete(row)?;
        if pause && !self.pause()? {
            return Ok(None);
        }
        Ok(Some(end))
    }

    /// Waits after a barrier until the supervisor lets it continue. `false` if the run is being stopped.
    fn pause(&mut self) -> Result<bool, StepError> {
        self.saving.settle()?;
        self.pulse.announce(Activity::Paused);
        let control = &self.control;
        let command = &mut self.command;
        let continues = || read_command(control, command).map(|()| !command.pause);
        self.ports.waiter.wait_until(|| Activity::Paused, continues)
    }
}
