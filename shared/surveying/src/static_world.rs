//! The static world of runs: what stays when vehicles and people are gone, and the ground below them.
//!
//! This crate copies values and estimates nothing. A caller that has estimated the ground (the crate `scene`) gives it here.

use crate::cloud::CloudPoint;
use crate::error::DeliverError;

/// A place of the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundSample {
    /// Coordinates in the frame of the clouds, m.
    pub xyz: [f64; 3],
    /// sRGB. `None` if no camera saw the ground here, or around here if it was completed.
    pub rgb: Option<[u8; 3]>,
}

/// What a caller has determined about runs.
pub trait StaticWorld: Sync {
    /// Whether a point is on something that moves or can move. `run` counts the runs.
    fn is_removed(&self, run: usize, point: &CloudPoint) -> bool;

    /// Passes the ground to `take`, in an order that depends on the runs alone. Neighboring samples are at most `spacing_m` apart along
    /// both axes of the frame of the clouds.
    fn each_ground(
        &self,
        spacing_m: f64,
        take: &mut dyn FnMut(&[GroundSample]) -> Result<(), DeliverError>,
    ) -> Result<(), DeliverError>;
}
