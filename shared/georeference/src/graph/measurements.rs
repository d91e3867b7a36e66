//! Measurements of submaps.

use geometry::{Point3, Pose, UnitQuaternion};
use nalgebra::{Matrix6, Vector3};
use serde::{Deserialize, Serialize};

/// Pose of one submap in another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RelativePose {
    /// Number of the reference submap, in whose frame the pose is.
    pub target: usize,
    /// Number of the measured submap.
    pub source: usize,
    /// The measurement.
    pub target_from_source: Pose,
    /// Inverse covariance: translation in the target's axes (m), then rotation in the source's (rad).
    pub information: Matrix6<f64>,
}

/// Position of a point of a submap in the world: the antenna of a GNSS receiver.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AntennaPosition {
    /// Number of the submap.
    pub submap: usize,
    /// Position in the submap, m.
    pub p_in_submap: Point3<f64>,
    /// Position in the world, m.
    pub p_in_world: Point3<f64>,
    /// Standard deviation along east, north, and down, m.
    pub sigma_m: [f64; 3],
    /// Standard deviation of heights above the true one, m. Reflected signals arrive late, never early, and raise the
    /// measured position, so the distribution is asymmetric.
    pub sigma_above_m: f64,
    /// Weight as a share of an independent measurement, greater than 0 and at most 1: errors of a receiver last longer
    /// than the time between two fixes.
    pub share: f64,
    /// Residuals are weighted with `sigma_m`, but are outliers only beyond this standard deviation, m. 0 disables the
    /// limit.
    pub tolerance_m: f64,
}

/// Horizontal velocity of the antenna in the world, from Doppler shifts. It constrains the heading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HorizontalVelocity {
    /// Number of the submap.
    pub submap: usize,
    /// Velocity from the odometry, m/s.
    pub v_in_submap: Vector3<f64>,
    /// Velocity from the receiver, towards east and north, m/s.
    pub v_in_world: [f64; 2],
    /// Standard deviation of each component, m/s.
    pub sigma_mps: f64,
}

/// Direction against gravity in a submap.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UpDirection {
    /// Number of the submap.
    pub submap: usize,
    /// Upward direction, a unit vector.
    pub up_in_submap: Vector3<f64>,
    /// Standard deviation, rad.
    pub sigma_rad: f64,
}

/// All measurements. Submaps are numbered from 0 in the order of the drive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseGraph {
    /// Pose of each submap after the first relative to the previous one, from the odometry.
    pub odometry: Vec<RelativePose>,
    /// Path length of each pose of `odometry` that may be bent upward or downward like the others, m; missing ones are 0.
    pub bent_m: Vec<f64>,
    /// Loop closures. They may be outliers.
    pub loops: Vec<RelativePose>,
    /// Positions. They may be outliers.
    pub positions: Vec<AntennaPosition>,
    /// Directions against gravity.
    pub up_directions: Vec<UpDirection>,
    /// Velocities. They may be outliers.
    pub velocities: Vec<HorizontalVelocity>,
}

/// Difference between a relative pose and its measurement.
pub(crate) struct RelativeError {
    /// Axes of the target, m.
    pub translation: Vector3<f64>,
    /// Axes of the source, rad.
    pub rotation: Vector3<f64>,
}

impl RelativePose {
    /// Difference between these poses and the measurement.
    pub(crate) fn error(&self, world_from_target: &Pose, world_from_source: &Pose) -> RelativeError {
        let found = world_from_target.inv_mul(world_from_source);
        let rotation: UnitQuaternion<f64> = self.target_from_source.rotation.inverse() * found.rotation;
        RelativeError {
            translation: found.translation.vector - self.target_from_source.translation.vector,
            rotation: rotation.scaled_axis(),
        }
    }
}
