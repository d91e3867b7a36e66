//! Reports stretches of the drive with a growing path error: the standard deviation of the pose increases.

use crate::Registered;
use crate::observability::time_spans::TimeSpans;
use doubts::Doubt;
use geometry::Pose;
use nalgebra::{Matrix6, Vector3};
use serde::{Deserialize, Serialize};

/// Heading error is converted to the displacement at this distance, m: the length of one or two submaps.
const LEVER_M: f64 = 50.0;
/// Least growth of the standard deviation in one sweep that belongs to a stretch, m. Sweeps of streets have some
/// millimetres, degenerate ones decimetres.
const MIN_GROWTH_M: f64 = 0.05;
/// Stretches with a shorter pause are merged, ns.
const PAUSE_NANOS: i64 = 1_000_000_000;

/// Collects stretches in which the standard deviation of position and heading grows. Serializing it saves the state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LostStretches {
    /// Pose and covariance at the last sweep.
    last: Option<(Pose, Matrix6<f64>)>,
    /// Growth of the variance in the stretches, m^2.
    growth: f64,
    spans: TimeSpans,
}

impl LostStretches {
    /// Adds the next sweep.
    pub fn add(&mut self, registered: &Registered) {
        let shots = [registered.stamp.0, registered.end_stamp().0];
        self.add_pose(shots, &registered.motion.mid, &registered.covariance);
    }

    fn add_pose(&mut self, shots: [i64; 2], pose: &Pose, covariance: &Matrix6<f64>) {
        self.spans.begin_drive(shots[0]);
        let Some((before, covariance_before)) = self.last.replace((*pose, *covariance)) else { return };
        let step = pose.translation.vector - before.translation.vector;
        let growth = weighted(covariance) - weighted(&moved(&covariance_before, &step));
        if growth > MIN_GROWTH_M * MIN_GROWTH_M {
            self.growth += growth;
            self.spans.add(shots, PAUSE_NANOS);
        }
    }

    /// The doubt if all stretches together increase the standard deviation by more than the limit, m.
    pub fn doubt(&self, limit_m: f64) -> Option<Doubt> {
        let growth_m = self.growth.sqrt();
        (growth_m > limit_m).then(|| Doubt::PathLost {
            growth_m,
            limit_m,
            lever_m: LEVER_M,
            seconds: self.spans.seconds(),
            stretches: self.spans.describe(),
        })
    }
}

/// The covariance of a pose after an error-free step, m.
fn moved(covariance: &Matrix6<f64>, step: &Vector3<f64>) -> Matrix6<f64> {
    let mut lever = Matrix6::identity();
    lever.fixed_view_mut::<3, 3>(0, 3).copy_from(&-step.cross_matrix());
    lever * covariance * lever.transpose()
}

/// Variance of the horizontal position plus variance of the heading at the lever arm, m^2.
fn weighted(covariance: &Matrix6<f64>) -> f64 {
    covariance[(0, 0)] + covariance[(1, 1)] + LEVER_M * LEVER_M * covariance[(5, 5)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Isometry3;

    const SWEEP_NANOS: i64 = 100_000_000;

    /// Stretches after sweeps 1 m apart. Each sweep adds the given standard deviations of position and heading (m,
    /// rad).
    fn after(sweeps: &[[f64; 2]]) -> LostStretches {
        let mut stretches = LostStretches::default();
        let mut covariance = Matrix6::zeros();
        for (number, [m, rad]) in sweeps.iter().enumerate() {
            let begin = 5_000_000_000 + number as i64 * SWEEP_NANOS;
            covariance = moved(&covariance, &Vector3::x());
            covariance[(0, 0)] += m * m;
            covariance[(5, 5)] += rad * rad;
            let pose = Isometry3::translation(number as f64, 0.0, 0.0);
            stretches.add_pose([begin, begin + SWEEP_NANOS], &pose, &covariance);
        }
        stretches
    }

    #[test]
    fn stretch_in_which_the_deviation_grows_is_named_with_its_times() {
        let found = after(&[vec![[0.01, 1e-4]; 30], vec![[2.0, 0.0]; 9], vec![[0.01, 1e-4]; 50]].concat());
        let doubt = found.doubt(5.0).expect("the path error grows");
        let growth_m = doubt.size();
        let text = doubt.to_string();
        assert!((growth_m - 6.0).abs() < 0.01, "{growth_m}");
        assert!(text.contains("0.9 s of the drive (3.0 to 3.9 s)") && text.contains("more than 5 m"), "{text}");
        assert_eq!(found.doubt(7.0), None);
    }

    #[test]
    fn lost_heading_counts_where_it_is_lost_and_not_on_the_way_after() {
        let found = after(&[vec![[0.01, 1e-4]; 10], vec![[0.0, 0.2]], vec![[0.01, 1e-4]; 500]].concat());
        let doubt = found.doubt(5.0).expect("the path error grows");
        let growth_m = doubt.size();
        let text = doubt.to_string();
        assert!((growth_m - 10.0).abs() < 0.01, "0.2 rad at 50 m: {growth_m}");
        assert!(text.contains("0.1 s of the drive (1.0 to 1.1 s)"), "{text}");
    }

    #[test]
    fn long_drive_with_small_errors_of_each_sweep_is_not_lost() {
        assert_eq!(after(&vec![[0.01, 1e-4]; 5000]).doubt(0.0), None);
    }
}
