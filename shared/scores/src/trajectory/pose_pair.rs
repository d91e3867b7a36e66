//! Pairs of true and estimated poses, and their absolute errors.

use geometry::{Pose, Stamp};

/// True and estimated pose at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePair {
    /// Time.
    pub stamp: Stamp,
    /// True pose, in the world of the truth.
    pub truth: Pose,
    /// Estimated pose, in the world of the estimate.
    pub estimate: Pose,
}

/// Distance between the positions of each pair, m: the absolute trajectory error (Sturm et al., IROS 2012), once
/// aligned.
pub fn position_errors(pairs: &[PosePair]) -> Vec<f64> {
    let error = |pair: &PosePair| (pair.estimate.translation.vector - pair.truth.translation.vector).norm();
    pairs.iter().map(error).collect()
}

/// Angle between the rotations of each pair, rad.
pub fn rotation_errors(pairs: &[PosePair]) -> Vec<f64> {
    pairs.iter().map(|pair| pair.truth.rotation.angle_to(&pair.estimate.rotation)).collect()
}

/// Distance along the truth from the first pair to each pair, m.
pub fn distances_along(pairs: &[PosePair]) -> Vec<f64> {
    let mut distance_m = 0.0;
    let mut last = None;
    let step = |pair: &PosePair| {
        let position = pair.truth.translation.vector;
        distance_m += last.map_or(0.0, |last: geometry::Vector3<f64>| (position - last).norm());
        last = Some(position);
        distance_m
    };
    pairs.iter().map(step).collect()
}
