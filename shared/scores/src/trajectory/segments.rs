//! KITTI's odometry errors (Geiger et al., CVPR 2012; the development kit's `evaluate_odometry.cpp`).

use super::pose_pair::{PosePair, distances_along};

/// Lengths of the development kit's segments, m.
pub const KITTI_LENGTHS_M: [f64; 8] = [100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0];
/// A segment starts at every tenth pose, every second at 10 Hz.
pub const KITTI_STEP: usize = 10;

/// Error over one segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Index of the pair at its start.
    pub first: usize,
    /// Index of the pair at its end.
    pub last: usize,
    /// Nominal length. The segment is longer by up to one step, which the kit ignores.
    pub length_m: f64,
    /// Translation error divided by `length_m`.
    pub translation: f64,
    /// Rotation error divided by `length_m`, rad/m.
    pub rotation_rad_per_m: f64,
}

/// The segments of each length from every `step`-th pair to the first pair that is *further* along the truth. Segments
/// beyond the end of the trajectory are skipped.
pub fn kitti_segments(pairs: &[PosePair], lengths_m: &[f64], step: usize) -> Vec<Segment> {
    let distances = distances_along(pairs);
    let mut segments = Vec::new();
    for first in (0..pairs.len()).step_by(step.max(1)) {
        for &length_m in lengths_m {
            let last = distances.partition_point(|distance_m| *distance_m <= distances[first] + length_m);
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

    /// A straight line in steps of 1 m. The estimate is 1 % too long and rolls by 0.01 degrees per metre.
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
    fn segment_ends_one_step_beyond_its_length() {
        let segments = kitti_segments(&pairs(320), &KITTI_LENGTHS_M, 10);
        // Starts 0, 10 ... : of 100 m up to 218, of 200 m up to 118, of 300 m up to 18.
        let count = |length_m: f64| segments.iter().filter(|segment| segment.length_m == length_m).count();
        assert_eq!([100.0, 200.0, 300.0, 400.0].map(count), [22, 12, 2, 0]);
        for segment in &segments {
            // One step beyond the nominal length.
            let distance_m = segment.length_m + 1.0;
            assert_eq!((segment.last - segment.first) as f64, distance_m);
            assert!((segment.translation - 0.01 * distance_m / segment.length_m).abs() < 1e-12);
            let expected = 0.01_f64.to_radians() * distance_m / segment.length_m;
            assert!((segment.rotation_rad_per_m - expected).abs() < 1e-12);
        }
        assert!(kitti_segments(&pairs(100), &KITTI_LENGTHS_M, 10).is_empty());
    }
}
