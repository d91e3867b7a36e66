//! Stretches of the drive with weak observability, reported to the operator.

pub(crate) mod along_track;
pub(crate) mod contested_motion;
pub(crate) mod degenerate_geometry;
pub(crate) mod lost_path;
pub(crate) mod perturbation_test;
pub(crate) mod time_spans;
pub(crate) mod unmatched_path;

use crate::Registered;
use contested_motion::ContestedStretches;
use degenerate_geometry::DegenerateStretches;
use doubts::Doubt;
use lost_path::LostStretches;
use serde::{Deserialize, Serialize};
use unmatched_path::UnmatchedStretches;

/// Collects stretches with degenerate geometry, with ambiguous ego-motion, with a growing path error, and without
/// matches. Serializing it saves the state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stretches {
    degenerate: DegenerateStretches,
    contested: ContestedStretches,
    lost: LostStretches,
    unmatched: UnmatchedStretches,
}

impl Stretches {
    /// Adds the next sweep. Returns a report if the sweep ends a stretch of degenerate geometry.
    pub fn add(&mut self, registered: &Registered) -> Option<String> {
        self.contested.add(registered);
        self.lost.add(registered);
        self.unmatched.add(registered);
        self.degenerate.add(registered)
    }

    /// Ends the drive. Returns a report on degenerate geometry at its end.
    pub fn finish(&mut self) -> Option<String> {
        self.degenerate.finish()
    }

    /// [`Doubt::MotionContested`] if the ego-motion was ambiguous for longer than the limit, s.
    pub fn contested(&self, max_s: f64) -> Option<Doubt> {
        self.contested.doubt(max_s)
    }

    /// [`Doubt::PathLost`] if stretches with an unconstrained motion increase the standard deviation of the path by
    /// more than the limit, m.
    pub fn lost(&self, max_m: f64) -> Option<Doubt> {
        self.lost.doubt(max_m)
    }

    /// [`Doubt::NoSweepMatched`] if no sweep of the drive was matched; [`Doubt::PathUnmatched`] if stretches without
    /// matches are longer than the limit, s. It does not depend on the stated deviations.
    pub fn unmatched(&self, max_s: f64) -> Option<Doubt> {
        self.unmatched.doubt(max_s)
    }
}
