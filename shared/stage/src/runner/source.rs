//! A source: nobody tells it what follows a tick but the supervisor, so it says to all others where barriers and the end are.

use super::{Runner, read_command};
use crate::health::Activity;
use crate::process::monotonic_nanos;
use crate::{Flow, Inputs, Mode, Stage, StepError};
use messages::{NO_DRIVE_TIME, TickRow};
use std::sync::atomic::Ordering;

impl<S: Stage> Runner<'_, S> {
    /// One tick of a source. `Some(true)`: the last one. `None`: the run is being stopped.
    pub(super) fn source_tick(&mut self) -> Result<Option<bool>, StepError> {
        if self.ports.waiter.stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        read_command(&self.control, &mut self.command)?;
        let born = monotonic_nanos();
        self.ports.clock.tick.set(self.tick);
        self.ports.clock.born_nanos.set(born);
        self.pulse.set(Activity::Working);
        let flow = self.timed_step(&mut Inputs::default())?;
        let end = flow == Flow::End || self.command.drain;
        if self.command.drain && flow == Flow::Continue {
            // A live source ends when it is asked to.
            if self.assignment.context.mode == Mode::Offline {
                self.outputs.note("drained on request: the rest of the drive was not read");
            }
            self.pulse.update().drained = true;
        }
        let drive_time = self.outputs.drive_time.unwrap_or(NO_DRIVE_TIME);
        if drive_time != NO_DRIVE_TIME && self.barrier_time.is_none_or(|since| since > drive_time) {
            // The first data, or a sensor's clock that has jumped back.
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

    /// Waits behind a barrier for the word to go on. `false` if the run is being stopped.
    fn pause(&mut self) -> Result<bool, StepError> {
        self.saving.settle()?;
        self.pulse.announce(Activity::Paused);
        let (control, command) = (&self.control, &mut self.command);
        let goes_on = || read_command(control, command).map(|()| !command.pause);
        self.ports.waiter.wait_until(|| Activity::Paused, goes_on)
    }
}
