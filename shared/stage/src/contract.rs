//! The contract of a stage: its duties and guarantees.
//!
//! Time is cut into *ticks*: one tick is one step of the source (one LiDAR revolution). In tick n a stage gets all
//! messages of tick n, from all its inputs, in the order they were published, and publishes its results.
//! Nothing depends on when a message arrives, so the same input gives the same output, always.

use crate::{Context, Inputs, Outputs, Port, Problem, Settings, StateBytes, StepError};
use std::path::Path;

/// One stage of the pipeline: a function of settings, state and inputs.
///
/// `step` reads no clock, no environment and no unseeded randomness, and does not log: it reports by [`Outputs::count`]
/// and [`Outputs::note`], which the runner logs.
pub trait Stage: Sized + 'static {
    /// Folder, crate, table in launch.toml, log target; the binary is `replica-<NAME>`.
    const NAME: &'static str;

    /// See [`settings!`](crate::settings!).
    type Settings: Settings + 'static;

    /// Topics that the stage reads.
    fn inputs() -> Vec<Port>;

    /// Topics that the stage writes.
    fn outputs() -> Vec<Port>;

    /// Topics that the stage reads with these settings: some or all of [`Stage::inputs`], where an optional one may be
    /// required here. Relative paths start at `launch_folder`.
    fn inputs_with(_settings: &Self::Settings, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        Ok(Self::inputs())
    }

    /// Topics that the stage writes with these settings: some or all of [`Stage::outputs`]. Relative paths start at
    /// `launch_folder`.
    fn outputs_with(_settings: &Self::Settings, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        Ok(Self::outputs())
    }

    /// Problems found before the start, beyond the settings' own rules: absent files, settings that contradict each other.
    fn check(_settings: &Self::Settings, _context: &Context) -> Vec<Problem> {
        Vec::new()
    }

    /// Prepares the stage for tick 0. Reads calibration and models; no sensor data is available yet.
    fn new(settings: &Self::Settings, context: &Context) -> Result<Self, StepError>;

    /// One tick. A source (no inputs) returns [`Flow::End`] with its last tick.
    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError>;

    /// Publishes the results that are still held, after the last tick.
    fn finish(&mut self, _outputs: &mut Outputs) -> Result<(), StepError> {
        Ok(())
    }

    /// Everything that the next tick depends on. Called between ticks, at a barrier. Use [`crate::encode_state`], or
    /// [`StateBytes::with_head`] if the stage holds messages. A stage that holds nothing between ticks returns no
    /// bytes: then any program may replace it.
    fn save(&mut self) -> Result<StateBytes<'_>, StepError>;

    /// Restores the state that [`Stage::save`] returned, possibly in the program that this one replaces. Called on a
    /// new stage before its first tick, unless there are no bytes. The default is for stages that save no state.
    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let n_bytes = state.len();
        Err(StepError::data(format!("this program has no state and cannot load one of {n_bytes} bytes")))
    }
}

/// Whether a source has more data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// There may be a next tick.
    Continue,
    /// This was the last tick. Only sources decide; the value of other stages is ignored.
    End,
}
