//! Pairs the poses of two trajectories.

use super::pose_pair::PosePair;
use geometry::{Pose, Stamp, Trajectory};

/// Pairs of poses, and counts of the poses without a pair.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Association {
    /// Sorted by time.
    pub pairs: Vec<PosePair>,
    /// Poses before the first or after the last true pose.
    pub n_outside: usize,
    /// Poses in a gap of the truth that is too long to interpolate.
    pub n_in_gaps: usize,
    /// Poses too close to the previous one.
    pub n_close: usize,
}

/// Finds the true pose at the time of each estimated pose: a true pose of this time, otherwise an interpolation between
/// its two neighbors (position linear, rotation along the shorter arc) if these are at most `max_gap_nanos` apart.
///
/// Poses less than `min_step_nanos` after the previous pair are ignored. A trajectory with poses at both ends of each sweep has two
/// poses at nearly the same time, which would distort errors from pose to pose.
pub fn associate(truth: &Trajectory, estimate: &Trajectory, max_gap_nanos: i64, min_step_nanos: i64) -> Association {
    let mut found = Association::default();
    let mut last: Option<Stamp> = None;
    let known = truth.poses();
    for (stamp, pose) in estimate.poses() {
        if last.is_some_and(|last| stamp.0 - last.0 < min_step_nanos) {
            found.n_close += 1;
            continue;
        }
        let Some(true_pose) = truth.at(*stamp) else {
            found.n_outside += 1;
            continue;
        };
        let after = known.partition_point(|(at, _)| at < stamp);
        let gap_nanos = if known[after].0 == *stamp { 0 } else { known[after].0.0 - known[after - 1].0.0 };
        if gap_nanos > max_gap_nanos {
            found.n_in_gaps += 1;
            continue;
        }
        last = Some(*stamp);
        found.pairs.push(PosePair { stamp: *stamp, truth: true_pose, estimate: *pose });
    }
    found
}

/// Pairs poses by their index. Surplus poses of one side count as outside. Pose `i` gets the time `i * period_nanos`.
pub fn associate_by_number(truth: &[Pose], estimate: &[Pose], period_nanos: i64) -> Association {
    let poses = (0..).zip(truth.iter().zip(estimate));
    let pair = |(number, (truth, estimate)): (i64, (&Pose, &Pose))| PosePair {
        stamp: Stamp(number * period_nanos),
        truth: *truth,
        estimate: *estimate,
    };
    Association {
        pairs: poses.map(pair).collect(),
        n_outside: truth.len().abs_diff(estimate.len()),
        ..Association::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along_x(times: &[i64]) -> Trajectory {
        let mut trajectory = Trajectory::default();
        for time in times {
            assert!(trajectory.push(Stamp(*time), Pose::translation(*time as f64, 0.0, 0.0)));
        }
        trajectory
    }

    #[test]
    fn truth_is_interpolated_except_in_gaps_and_beyond_its_ends() {
        let truth = along_x(&[0, 10, 20, 100, 110]);
        let found = associate(&truth, &along_x(&[-5, 0, 5, 20, 21, 50, 100, 104, 111]), 10, 2);
        let stamps: Vec<i64> = found.pairs.iter().map(|pair| pair.stamp.0).collect();
        assert_eq!(stamps, [0, 5, 20, 100, 104]);
        assert!(found.pairs.iter().all(|pair| (pair.truth.translation.x - pair.stamp.0 as f64).abs() < 1e-12));
        assert_eq!((found.n_outside, found.n_in_gaps, found.n_close), (2, 1, 1));
    }

    #[test]
    fn poses_without_times_are_paired_by_index() {
        let poses: Vec<Pose> = (0..3).map(|i| Pose::translation(f64::from(i), 0.0, 0.0)).collect();
        let found = associate_by_number(&poses, &poses[..2], 100);
        assert_eq!((found.pairs.len(), found.pairs[1].stamp, found.n_outside), (2, Stamp(100), 1));
    }
}
