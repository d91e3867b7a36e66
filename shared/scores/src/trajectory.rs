//! Trajectories against truth: absolute errors, errors over a number of poses or a way, and KITTI's over segments.
//!
//! All measures are of [`PosePair`]s: what [`associate`] found for the same instants. An error is small only if both
//! trajectories are of the same thing (the body, or the lidar); the world frames may differ.

mod align;
mod associate;
mod relative;
mod segments;

pub use align::{AlignError, Alignment, Similarity, align};
pub use associate::{Association, associate, associate_by_number};
pub use relative::{Relative, pairs_by_count, pairs_by_way, relative_errors};
pub use segments::{KITTI_LENGTHS_M, KITTI_STEP, Segment, kitti_segments};

use geometry::{Pose, Stamp};

/// Both poses of an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePair {
    /// When.
    pub stamp: Stamp,
    /// Where the thing was, in the world of the truth.
    pub truth: Pose,
    /// Where it was found, in the world of the estimate.
    pub estimate: Pose,
}

/// Distance of the positions of each pair, m: the absolute trajectory error (Sturm et al., IROS 2012), once aligned.
pub fn position_errors(pairs: &[PosePair]) -> Vec<f64> {
    let error = |pair: &PosePair| (pair.estimate.translation.vector - pair.truth.translation.vector).norm();
    pairs.iter().map(error).collect()
}

/// Angle between the rotations of each pair, rad.
pub fn rotation_errors(pairs: &[PosePair]) -> Vec<f64> {
    pairs.iter().map(|pair| pair.truth.rotation.angle_to(&pair.estimate.rotation)).collect()
}

/// Way along the truth from the first pair to each, m.
pub fn ways(pairs: &[PosePair]) -> Vec<f64> {
    let (mut way_m, mut last) = (0.0, None);
    let step = |pair: &PosePair| {
        let position = pair.truth.translation.vector;
        way_m += last.map_or(0.0, |last: geometry::Vector3<f64>| (position - last).norm());
        last = Some(position);
        way_m
    };
    pairs.iter().map(step).collect()
}
