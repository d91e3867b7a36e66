//! KITTI's odometry errors (Geiger et al., CVPR 2012; the development kit's `evaluate_odometry.cpp`).

use super::{PosePair, ways};

/// Lengths of the kit's segments, m.
pub const KITTI_LENGTHS_M: [f64; 8] = [100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0];
/// Segments begin at every tenth pose, a second apart at 10 Hz.
pub const KITTI_STEP: usize = 10;

/// Error over a part of the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Index of the pair at its begin.
    pub first: usize,
    /// Index of the pair at its end.
    pub last: usize,
    /// As asked for; the segment itself is longer by up to a step, which the kit does not count.
    pub length_m: f64,
    /// Length of the translation error by `length_m`, a share.
    pub translation: f64,
    /// Rotation error by `length_m`, rad/m.
    pub rotation_rad_per_m: f64,
}

/// From every `step`-th pair and of each length: up to the first pair that is *further* along the truth than this. Segments
/// that the drive is too short for are left out.
pub fn kitti_segments(pairs: &[PosePair], lengths_m: &[f64], step: usize) -> Vec<Segment> {
    let ways = ways(pairs);
    let mut segments = Vec::new();
    for first in (0..pairs.len()).step_by(step.max(1)) {
        for &length_m in lengths_m {
            let last = ways.partition_point(|way_m| *way_m <= ways[first] + length_m);
            let Some(end) = pairs.get(last) else { continue };
            let begin = &pairs[first];
            let truth = begin.truth.inv_mul(&end.truth);
            let estimate = begin.estimate.inv_mul(&end.estimate);
            let error = estimate.inv_mul(&truth);
            segments.push(Segment {
                first,
                last,
                length_m,
                translation: error.translation.vector.norm() / length_m,
                rotation_rad_per_m: error.rotation.angle() / length_m,
            });
        }
    }
    segments
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Pose, Stamp, Vector3};

    /// A straight way of 1 m steps; the estimate is 1 % too long and turns by 0.01 degrees a meter about its own axis.
    fn pairs(n: usize) -> Vec<PosePair> {
        let pair = |i: usize| {
            let x = i as f64;
            let turn = Vector3::x() * (0.01_f64.to_radians() * x);
            PosePair {
                stamp: Stamp(i as i64),
                truth: Pose::translation(x, 0.0, 0.0),
                estimate: Pose::new(Vector3::new(1.01 * x, 0.0, 0.0), turn),
            }
        };
        (0..n).map(pair).collect()
    }

    #[test]
    fn errors_are_by_length_and_segments_end_beyond_it() {
        let segments = kitti_segments(&pairs(320), &KITTI_LENGTHS_M, 10);
        // Begins 0, 10 ... : of 100 m up to 218, of 200 m up to 118, of 300 m up to 18.
        let count = |length_m: f64| segments.iter().filter(|segment| segment.length_m == length_m).count();
        assert_eq!([100.0, 200.0, 300.0, 400.0].map(count), [22, 12, 2, 0]);
        for segment in &segments {
            // One step beyond the length: not at it.
            let way = segment.length_m + 1.0;
            assert_eq!((segment.last - segment.first) as f64, way);
            assert!((segment.translation - 0.01 * way / segment.length_m).abs() < 1e-12);
            let expected = 0.01_f64.to_radians() * way / segment.length_m;
            assert!((segment.rotation_rad_per_m - expected).abs() < 1e-12);
        }
        assert!(kitti_segments(&pairs(100), &KITTI_LENGTHS_M, 10).is_empty());
    }
}
