//! The graph on drives whose truth is known: a round over hills, with everything that may be wrong about it.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use geometry::{Isometry3, Point3, Pose, UnitQuaternion, Vector3};
use nalgebra::{Matrix6, Vector6};
use pose_graph::{Gauge, PoseGraph, Position, Relative, Solution, Upright};

/// Submaps of a round of 1.5 km.
const N: usize = 75;

/// Numbers as if drawn, normal enough: the sum of twelve even ones.
struct Random(u64);
impl Random {
    fn gauss(&mut self) -> f64 {
        let mut even = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| even()).sum::<f64>() - 6.0
    }
    fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::new(self.gauss(), self.gauss(), self.gauss()) * sigma
    }
}

fn truth() -> Vec<Pose> {
    let pose = |k: usize| {
        let angle = k as f64 / N as f64 * std::f64::consts::TAU;
        let at = Vector3::new(240.0 * angle.sin(), 240.0 * (1.0 - angle.cos()), 8.0 * (2.0 * angle).sin());
        Isometry3::from_parts(at.into(), UnitQuaternion::from_euler_angles(0.02, 0.03 * (2.0 * angle).cos(), angle))
    };
    (0..=N).map(pose).collect()
}

fn information(sigma_m: f64, sigma_rad: f64) -> Matrix6<f64> {
    let (m, rad) = (sigma_m.powi(-2), sigma_rad.powi(-2));
    Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad))
}

/// Odometry with the errors of one that drifts by 0.4 %, and the poses that it alone gives.
fn odometry(truth: &[Pose], random: &mut Random) -> (PoseGraph, Vec<Pose>) {
    let mut graph = PoseGraph::default();
    let mut poses = vec![truth[0]];
    for source in 1..truth.len() {
        let target = source - 1;
        let error = Isometry3::new(random.vector(0.03), random.vector(0.002));
        let target_from_source = truth[target].inv_mul(&truth[source]) * error;
        graph.odometry.push(Relative { target, source, target_from_source, information: information(0.03, 0.002) });
        poses.push(poses[target] * target_from_source);
    }
    (graph, poses)
}

fn position(truth: &[Pose], submap: usize, error: Vector3<f64>) -> Position {
    let p_in_submap = Point3::new(6.0, -0.5, 1.8);
    let p_in_world = truth[submap] * p_in_submap + error;
    Position { submap, p_in_submap, p_in_world, sigma_m: [0.7, 0.7, 1.5], sigma_above_m: 1.5, share: 1.0 }
}

fn rmse(found: &[Pose], truth: &[Pose]) -> f64 {
    let squares: f64 =
        found.iter().zip(truth).map(|(a, b)| (a.translation.vector - b.translation.vector).norm_squared()).sum();
    (squares / truth.len() as f64).sqrt()
}

fn true_loop(truth: &[Pose], target: usize, source: usize) -> Relative {
    let target_from_source = truth[target].inv_mul(&truth[source]);
    Relative { target, source, target_from_source, information: information(0.03, 0.001) }
}

#[test]
fn measurements_without_errors_give_the_truth_from_a_bad_start() {
    let truth = truth();
    let mut random = Random(1);
    let (mut graph, drifted) = odometry(&truth, &mut random);
    for relative in &mut graph.odometry {
        relative.target_from_source = truth[relative.target].inv_mul(&truth[relative.source]);
    }
    graph.loops.push(true_loop(&truth, 0, N));
    assert!(rmse(&drifted, &truth) > 0.5, "the start must be wrong");
    let solution = graph.solve(&drifted, Gauge::FirstPose).unwrap();
    assert!(rmse(&solution.poses, &truth) < 1e-5, "{} m", rmse(&solution.poses, &truth));
    assert!(solution.loop_weights[0] > 0.99);
}

#[test]
fn a_closed_loop_takes_the_drift_away_and_says_how_well() {
    let truth = truth();
    let (mut before, mut after, mut normalized) = (0.0, 0.0, 0.0);
    for seed in 0..20 {
        let (mut graph, drifted) = odometry(&truth, &mut Random(seed));
        graph.loops.push(true_loop(&truth, 0, N));
        let solution = graph.solve(&drifted, Gauge::FirstPose).unwrap();
        before += rmse(&drifted, &truth) / 20.0;
        after += rmse(&solution.poses, &truth) / 20.0;
        let end = truth[N].inv_mul(&solution.poses[N]);
        assert!(end.translation.vector.norm() < 0.1, "seed {seed}: the end is off by {end}");
        // The covariance half way, where it is largest, against the errors there.
        let error = truth[N / 2].inv_mul(&solution.poses[N / 2]);
        let mut off = Vector6::zeros();
        off.fixed_rows_mut::<3>(0).copy_from(&error.translation.vector);
        off.fixed_rows_mut::<3>(3).copy_from(&error.rotation.scaled_axis());
        normalized += off.dot(&(solution.covariances[N / 2].try_inverse().unwrap() * off)) / 6.0 / 20.0;
    }
    assert!(after < 0.5 * before, "{before} m became {after} m");
    assert!((0.6..1.6).contains(&normalized), "errors are {normalized} times what the covariance says");
}

#[test]
fn wrong_loops_and_positions_are_told_from_right_ones() {
    let truth = truth();
    let mut random = Random(7);
    let (mut graph, drifted) = odometry(&truth, &mut random);
    graph.loops.push(true_loop(&truth, 0, N));
    graph.loops.push(true_loop(&truth, 1, N - 1));
    // Two streets that look alike.
    graph.loops.push(Relative { target_from_source: Pose::identity(), ..true_loop(&truth, 10, 50) });
    graph.loops.push(Relative { target_from_source: Pose::identity(), ..true_loop(&truth, 12, 48) });
    // A quarter of the positions comes by way of walls, many in a row, tens of metres off.
    let is_wrong = |k: usize| (20..30).contains(&k) || (55..64).contains(&k);
    for k in 0..=N {
        let reflected = if is_wrong(k) { Vector3::new(18.0, -25.0, 30.0) } else { Vector3::zeros() };
        graph.positions.push(position(&truth, k, random.vector(0.5) + reflected));
    }
    let solution = graph.solve(&drifted, Gauge::Positions).unwrap();
    let off = rmse(&solution.poses, &truth);
    assert!(off < 0.35, "{off} m");
    assert!(solution.loop_weights[..2].iter().all(|w| *w > 0.5), "{:?}", solution.loop_weights);
    assert!(solution.loop_weights[2..].iter().all(|w| *w < 0.01), "{:?}", solution.loop_weights);
    for (k, weight) in solution.position_weights.iter().enumerate() {
        assert_eq!(*weight < 0.25, is_wrong(k), "position {k} has weight {weight}");
    }
    assert_eq!(Solution::n_believed(&solution.position_weights), N + 1 - 19);
    // Least squares alone would be metres off.
    let mut all = graph.clone();
    for p in &mut all.positions {
        (p.sigma_m, p.sigma_above_m) = (p.sigma_m.map(|s| s * 1e3), p.sigma_above_m * 1e3);
    }
    all.loops.clear();
    all.odometry.iter_mut().for_each(|r| r.information *= 1e-6);
    let plain = all.solve(&drifted, Gauge::Positions).unwrap();
    assert!(rmse(&plain.poses, &truth) > 5.0 * off, "{}", rmse(&plain.poses, &truth));
}

#[test]
fn heights_lifted_by_walls_do_not_lift_the_drive() {
    let truth = truth();
    let lift = |sigma_above_m: f64| {
        let mut random = Random(11);
        let (mut graph, drifted) = odometry(&truth, &mut random);
        for k in 0..=N {
            // Two of three come out too high, by some metres.
            let wall = if k % 3 == 0 { 0.0 } else { 2.0 * random.gauss().abs() };
            let error = random.vector(0.3) + Vector3::z() * wall;
            graph.positions.push(Position { sigma_above_m, ..position(&truth, k, error) });
        }
        let solution = graph.solve(&drifted, Gauge::Positions).unwrap();
        let off = |(found, pose): (&Pose, &Pose)| found.translation.z - pose.translation.z;
        solution.poses.iter().zip(&truth).map(off).sum::<f64>() / truth.len() as f64
    };
    let (even, halves) = (lift(1.5), lift(9.0));
    assert!(even > 0.6, "walls must matter: {even} m");
    assert!(halves.abs() < 0.3, "{halves} m");
}

#[test]
fn gravity_says_which_way_is_up_and_no_more() {
    let truth = truth();
    let mut random = Random(3);
    let (mut graph, drifted) = odometry(&truth, &mut random);
    for (submap, pose) in truth.iter().enumerate() {
        let up_in_submap = (pose.rotation.inverse() * Vector3::z() + random.vector(0.002)).normalize();
        graph.uprights.push(Upright { submap, up_in_submap, sigma_rad: 0.003 });
    }
    // The odometry began tilted by three degrees.
    let tilt = Isometry3::rotation(Vector3::new(0.05, -0.02, 0.0));
    let start: Vec<Pose> = drifted.iter().map(|pose| tilt * pose).collect();
    let solution = graph.solve(&start, Gauge::FirstPlaceAndHeading).unwrap();
    let tilt_of = |a: &Pose, b: &Pose| {
        let up = |pose: &Pose| pose.rotation.inverse() * Vector3::z();
        up(a).angle(&up(b))
    };
    for (k, (found, pose)) in solution.poses.iter().zip(&truth).enumerate() {
        assert!(tilt_of(found, pose) < 0.006, "submap {k}: {} rad", tilt_of(found, pose));
    }
    assert!(tilt_of(&start[N], &truth[N]) > 0.03);
    assert!((solution.poses[0].translation.vector - start[0].translation.vector).norm() < 1e-6);
    let turned = (start[0].rotation.inverse() * solution.poses[0].rotation).scaled_axis().z;
    assert!(turned.abs() < 1e-6, "{turned}");
}

#[test]
fn what_cannot_be_solved_is_not() {
    let truth = truth();
    let (graph, drifted) = odometry(&truth, &mut Random(5));
    assert_eq!(graph.solve(&[], Gauge::FirstPose), None);
    assert_eq!(graph.solve(&drifted[..10], Gauge::FirstPose), None, "measurements of submaps that are not there");
}

#[test]
fn a_saved_graph_gives_the_same_bits() {
    let truth = truth();
    let mut random = Random(9);
    let (mut graph, drifted) = odometry(&truth, &mut random);
    graph.loops.push(true_loop(&truth, 2, N - 2));
    graph.positions.push(position(&truth, 3, random.vector(0.5)));
    let bytes = postcard::to_stdvec(&graph).unwrap();
    let again: PoseGraph = postcard::from_bytes(&bytes).unwrap();
    assert_eq!(graph.solve(&drifted, Gauge::FirstPose), again.solve(&drifted, Gauge::FirstPose));
}
