//! Error of one pose.

use geometry::{Pose, heading};

/// Error of a pose in a world whose z axis is vertical. All values are 0 or above.
#[derive(Clone, Copy, Debug)]
pub struct PoseError {
    /// Horizontal error, m.
    pub horizontal_m: f64,
    /// Height error, m.
    pub height_m: f64,
    /// Heading error, degrees.
    pub heading_deg: f64,
}

impl PoseError {
    /// The error of an estimate.
    pub fn between(truth: &Pose, estimate: &Pose) -> Self {
        let off = estimate.translation.vector - truth.translation.vector;
        let turn = heading(&estimate.rotation).angle_to(&heading(&truth.rotation));
        Self { horizontal_m: off.x.hypot(off.y), height_m: off.z.abs(), heading_deg: turn.to_degrees() }
    }
}
