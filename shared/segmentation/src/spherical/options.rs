//! Options of a run that are not part of the model.

use super::Refinement;

/// Options of a run that are not part of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// One of so many sweeps goes through the network; 1 for all. Models that do not use sweeps ignore it.
    pub every: usize,
    /// Corrections of the classes, none by default.
    pub refinement: Refinement,
}

impl Default for Options {
    fn default() -> Self {
        Self { every: 1, refinement: Refinement::default() }
    }
}
