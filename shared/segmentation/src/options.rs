//! Options of a run that are not part of the model.

use crate::compute_device::ComputeDevice;
use crate::intensity::IntensityUse;
use crate::refinement::Refinement;

/// Options of a run that are not part of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// One in this many sweeps goes through the network; 1 for all. Models that do not use sweeps ignore it.
    pub every: usize,
    /// Number of sweeps that go through the network together, at least 1. The classes do not depend on it.
    pub batch: usize,
    /// Number of views that vote, 1 to [`crate::MOST_VIEWS`]; 1 is the submap itself. Models without probabilities ignore it.
    pub views: usize,
    /// Compute device of the network.
    pub device: ComputeDevice,
    /// Use of the intensities.
    pub intensity: IntensityUse,
    /// Corrections of the classes.
    pub refinement: Refinement,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            every: 1,
            batch: 1,
            views: 1,
            device: ComputeDevice::Cpu,
            intensity: IntensityUse::default(),
            refinement: Refinement::default(),
        }
    }
}
