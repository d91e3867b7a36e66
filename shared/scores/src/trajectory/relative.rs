//! Relative pose errors (Sturm et al., IROS 2012), counted as `evo_rpe` does: over intervals one after the other.

use super::PosePair;

/// Error of the motion over an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relative {
    /// Index of the pair at its begin.
    pub first: usize,
    /// Index of the pair at its end.
    pub last: usize,
    /// m.
    pub translation_m: f64,
    /// rad.
    pub rotation_rad: f64,
}

/// Intervals of `count` poses, one after the other; `count` is 1 or more.
pub fn pairs_by_count(n_pairs: usize, count: usize) -> Vec<(usize, usize)> {
    let ends: Vec<usize> = (0..n_pairs).step_by(count.max(1)).collect();
    ends.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

/// Intervals that end at the first pose whose way along the *estimate*, from the begin of the interval, is `way_m` or more.
pub fn pairs_by_way(pairs: &[PosePair], way_m: f64) -> Vec<(usize, usize)> {
    let mut ends = vec![0];
    let mut way = 0.0;
    for i in 1..pairs.len() {
        let [a, b] = [&pairs[i - 1], &pairs[i]].map(|pair| pair.estimate.translation.vector);
        way += (b - a).norm();
        if way >= way_m {
            ends.push(i);
            way = 0.0;
        }
    }
    ends.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

/// The error of each interval: of the estimate's motion as seen from the truth's.
pub fn relative_errors(pairs: &[PosePair], intervals: &[(usize, usize)]) -> Vec<Relative> {
    let error = |&(first, last): &(usize, usize)| {
        let (a, b) = (&pairs[first], &pairs[last]);
        let truth = a.truth.inv_mul(&b.truth);
        let error = truth.inv_mul(&a.estimate.inv_mul(&b.estimate));
        Relative { first, last, translation_m: error.translation.vector.norm(), rotation_rad: error.rotation.angle() }
    };
    intervals.iter().map(error).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Pose, Stamp, Vector3};

    #[test]
    fn intervals_follow_each_other() {
        assert_eq!(pairs_by_count(8, 3), [(0, 3), (3, 6)]);
        let pair = |x: f64| {
            let truth = Pose::translation(x, 0.0, 0.0);
            PosePair { stamp: Stamp(0), truth, estimate: Pose::translation(2.0 * x, 0.0, 0.0) }
        };
        let pairs: Vec<PosePair> = [0.0, 1.0, 2.0, 2.5, 4.0, 9.0].map(pair).to_vec();
        // Twice as long a way along the estimate.
        assert_eq!(pairs_by_way(&pairs, 4.0), [(0, 2), (2, 4), (4, 5)]);
        let errors = relative_errors(&pairs, &[(0, 2), (4, 5)]);
        assert_eq!([errors[0].translation_m, errors[1].translation_m], [2.0, 5.0]);
    }

    #[test]
    fn the_world_frames_do_not_matter_and_the_end_s_rotation_does() {
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
