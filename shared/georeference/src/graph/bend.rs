//! A bend of the whole path upward or downward, by errors that are the same in all sweeps.
//!
//! A LiDAR whose rings are off by a constant angle sees flat ground as a slope that depends on the range. Matched sweep by sweep, this
//! turns the path by the same pitch on each metre. Independent errors of the submaps do not cover it: they grow with the root of the
//! path, the pitch of a bend with the path, and its height with the square of the path.

use super::PoseGraph;
use super::elimination::Factored;
use super::factors::RelativeFactor;
use geometry::Pose;
use nalgebra::{Matrix6, Vector6};

/// Standard deviation of the pitch per path length, rad/m. Chosen on sweeps 0 to 340 of muehlburger, a flat road of 120 m without
/// inertial unit: the pitch of the path bends by 1.0e-4, its height by 1.9e-4 (`lab/peers/README.md`; KISS-ICP 2.0e-4, VGICP 3.7e-4).
const BEND_RAD_PER_M: f64 = 1.5e-4;

/// Adds the bend, an unknown that all poses share, to the covariances of the poses. `factored`: the normal equations at the poses.
pub(super) fn add_bend(covariances: &mut [Matrix6<f64>], graph: &PoseGraph, poses: &[Pose], factored: &Factored) {
    let mut gradient = vec![Vector6::zeros(); poses.len()];
    let mut information = BEND_RAD_PER_M.powi(-2);
    for (relative, m) in graph.odometry.iter().zip(&graph.bent_m).filter(|(_, m)| **m > 0.0) {
        // The vehicle drives along x; a rotation about y moves it down.
        let by_bend = Vector6::new(0.0, 0.0, -m * m / 2.0, 0.0, *m, 0.0);
        let weighted = relative.information * by_bend;
        let factor = RelativeFactor::new(relative, &poses[relative.target], &poses[relative.source]);
        gradient[relative.target] += factor.by_target.transpose() * weighted;
        gradient[relative.source] += factor.by_source.transpose() * weighted;
        information += by_bend.dot(&weighted);
    }
    if gradient.iter().all(|part| *part == Vector6::zeros()) {
        return;
    }
    let by_bend = factored.solve(&gradient);
    let known: f64 = gradient.iter().zip(&by_bend).map(|(gradient, step)| gradient.dot(step)).sum();
    // Without measurements of heights and tilts the difference is the information before, apart from rounding.
    let variance = (information - known).max(BEND_RAD_PER_M.powi(-2)).recip();
    for (covariance, step) in covariances.iter_mut().zip(&by_bend) {
        *covariance += step * step.transpose() * variance;
    }
}

#[cfg(test)]
mod tests {
    use super::BEND_RAD_PER_M;
    use crate::{AntennaPosition, Gauge, PoseGraph, RelativePose, UpDirection};
    use geometry::{Isometry3, Point3, Pose, Vector3};
    use nalgebra::Matrix6;

    const STEP_M: f64 = 20.0;

    /// A straight drive of 300 m.
    fn graph(bent_m: f64) -> (PoseGraph, Vec<Pose>) {
        let poses: Vec<Pose> = (0..16).map(|k| Isometry3::translation(STEP_M * f64::from(k), 0.0, 0.0)).collect();
        let step = |target: usize| RelativePose {
            target,
            source: target + 1,
            target_from_source: Isometry3::translation(STEP_M, 0.0, 0.0),
            information: Matrix6::identity() * 1e8,
        };
        (PoseGraph { odometry: (0..15).map(step).collect(), bent_m: vec![bent_m; 15], ..PoseGraph::default() }, poses)
    }

    fn height_deviation(graph: &PoseGraph, poses: &[Pose], gauge: Gauge) -> f64 {
        let solution = graph.solve(poses, gauge).expect("is determined");
        solution.covariances.last().expect("has poses")[(2, 2)].sqrt()
    }

    #[test]
    fn height_deviation_of_a_bend_grows_with_the_square_of_the_path() {
        let (bent, poses) = graph(STEP_M);
        let expected = BEND_RAD_PER_M * 300.0_f64.powi(2) / 2.0;
        let found = height_deviation(&bent, &poses, Gauge::FirstPose);
        assert!((found / expected - 1.0).abs() < 0.02, "{found} m, expected {expected}");
        let (straight, _) = graph(0.0);
        assert!(height_deviation(&straight, &poses, Gauge::FirstPose) < 0.1);
    }

    #[test]
    fn gravity_and_heights_of_fixes_limit_the_bend() {
        let (mut bent, poses) = graph(STEP_M);
        let up = |submap| UpDirection { submap, up_in_submap: Vector3::z(), sigma_rad: 1e-3 };
        bent.up_directions = (0..16).map(up).collect();
        assert!(height_deviation(&bent, &poses, Gauge::FirstPositionAndHeading) < 0.5);
        let (mut bent, poses) = graph(STEP_M);
        // Left and right of the path, which constrains the roll.
        let left_m = |submap: usize| if submap.is_multiple_of(2) { 1.0 } else { -1.0 };
        let fix = |submap: usize| AntennaPosition {
            submap,
            p_in_submap: Point3::new(0.0, left_m(submap), 0.0),
            p_in_world: Point3::new(STEP_M * submap as f64, left_m(submap), 0.0),
            sigma_m: [0.1; 3],
            sigma_above_m: 0.1,
            share: 1.0,
            tolerance_m: 0.0,
        };
        bent.positions = (0..16).map(fix).collect();
        assert!(height_deviation(&bent, &poses, Gauge::Positions) < 0.15);
    }
}
