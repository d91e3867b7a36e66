//! What was measured about submaps.

use geometry::{Point3, Pose, UnitQuaternion};
use nalgebra::{Matrix6, Vector3};
use serde::{Deserialize, Serialize};

/// How one submap lies in another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Relative {
    /// Number of the submap whose frame is the measurement's.
    pub target: usize,
    /// Number of the submap that is measured.
    pub source: usize,
    /// The measurement.
    pub target_from_source: Pose,
    /// Inverse covariance: translation in the target's axes (m), then rotation in the source's (rad).
    pub information: Matrix6<f64>,
}

/// Where a point of a submap was in the world: the antenna of a receiver.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Position {
    /// Number of the submap.
    pub submap: usize,
    /// m.
    pub p_in_submap: Point3<f64>,
    /// m.
    pub p_in_world: Point3<f64>,
    /// Standard deviation along east, north, and down, m.
    pub sigma_m: [f64; 3],
    /// That of heights above the truth, m: signals that come by way of walls are late, never early, and lift the position (a
    /// normal distribution of two halves).
    pub sigma_above_m: f64,
    /// How much of an independent measurement it is, above 0 to 1: errors of a receiver last longer than its pauses.
    pub share: f64,
}

/// Which way is up in a submap.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Upright {
    /// Number of the submap.
    pub submap: usize,
    /// Unit.
    pub up_in_submap: Vector3<f64>,
    /// Standard deviation, rad.
    pub sigma_rad: f64,
}

/// All measurements. Submaps are numbered from 0 in the order of the drive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseGraph {
    /// Each submap after the first in the one before it, by odometry.
    pub odometry: Vec<Relative>,
    /// Places that were seen again. They may be wrong.
    pub loops: Vec<Relative>,
    /// Positions. They may be wrong.
    pub positions: Vec<Position>,
    /// Directions of gravity.
    pub uprights: Vec<Upright>,
}

impl Relative {
    /// Difference between what the poses say and what was measured: translation in the target's axes, rotation in the
    /// source's.
    pub(crate) fn error(&self, world_from_target: &Pose, world_from_source: &Pose) -> (Vector3<f64>, Vector3<f64>) {
        let found = world_from_target.inv_mul(world_from_source);
        let turn: UnitQuaternion<f64> = self.target_from_source.rotation.inverse() * found.rotation;
        (found.translation.vector - self.target_from_source.translation.vector, turn.scaled_axis())
    }
}
