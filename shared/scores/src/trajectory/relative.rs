//! Relative pose errors (Sturm et al., IROS 2012), over consecutive intervals as in `evo_rpe`.

use super::pose_pair::PosePair;

/// Error of the motion over one interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeError {
    /// Index of the pair at its start.
    pub first: usize,
    /// Index of the pair at its end.
    pub last: usize,
    /// Translation error, m.
    pub translation_m: f64,
    /// Rotation error, rad.
    pub rotation_rad: f64,
}

/// Consecutive intervals of `count` poses; `count` is 1 or more.
pub fn intervals_by_count(n_pairs: usize, count: usize) -> Vec<(usize, usize)> {
    let ends: Vec<usize> = (0..n_pairs).step_by(count.max(1)).collect();
    ends.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

/// Consecutive intervals that end at the first pose whose distance along the *estimate* from their start is `least_m` or more.
pub fn intervals_by_distance(pairs: &[PosePair], least_m: f64) -> Vec<(usize, usize)> {
    let mut ends = vec![0];
    let mut distance_m = 0.0;
    for i in 1..pairs.len() {
        let [a, b] = [&pairs[i - 1], &pairs[i]].map(|pair| pair.estimate.translation.vector);
        distance_m += (b - a).norm();
        if distance_m >= least_m {
            ends.push(i);
            distance_m = 0.0;
        }
    }
    ends.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

/// The error of each interval: the estimated motion relative to the true motion.
pub fn relative_errors(pairs: &[PosePair], intervals: &[(usize, usize)]) -> Vec<RelativeError> {
    let error = |&(first, last): &(usize, usize)| {
        let a = &pairs[first];
        let b = &pairs[last];
        let truth = a.truth.inv_mul(&b.truth);
        let error = truth.inv_mul(&a.estimate.inv_mul(&b.estimate));
        RelativeError {
            first,
            last,
            translation_m: error.translation.vector.norm(),
            rotation_rad: error.rotation.angle(),
        }
    };
    intervals.iter().map(error).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Pose, Stamp, Vector3};

    #[test]
    fn intervals_are_consecutive() {
        assert_eq!(intervals_by_count(8, 3), [(0, 3), (3, 6)]);
        let pair = |x: f64| {
            let truth = Pose::translation(x, 0.0, 0.0);
            PosePair { stamp: Stamp(0), truth, estimate: Pose::translation(2.0 * x, 0.0, 0.0) }
        };
        let pairs: Vec<PosePair> = [0.0, 1.0, 2.0, 2.5, 4.0, 9.0].map(pair).to_vec();
        // Distances along the estimate are twice the distances along the truth.
        assert_eq!(intervals_by_distance(&pairs, 4.0), [(0, 2), (2, 4), (4, 5)]);
        let errors = relative_errors(&pairs, &[(0, 2), (4, 5)]);
        assert_eq!([errors[0].translation_m, errors[1].translation_m], [2.0, 5.0]);
    }

    #[test]
    fn relative_error_does_not_depend_on_world_frames() {
        let elsewhere = Pose::new(Vector3::new(5.0, 6.0, 7.0), Vector3::new(1.0, 0.5, -2.0));
        let a = Pose::new(Vector3::new(1.0, 0.0, 0.0), Vector3::z() * 0.5);
        let b = Pose::new(Vector3::new(3.0, 1.0, 0.0), Vector3::z() * 0.7);
        let turned = b * Pose::rotation(Vector3::x() * 0.01);
        let pairs = [(a, a), (b, turned)].map(|(truth, estimate)| PosePair {
            stamp: Stamp(0),
            truth,
            estimate: elsewhere * estimate,
        });
        let [error] = relative_errors(&pairs, &[(0, 1)])[..] else { panic!("one interval") };
        assert!(error.translation_m < 1e-12 && (error.rotation_rad - 0.01).abs() < 1e-12);
    }
}
