//! The pose graph on a round over hills, with drift, outliers and tilt.

use geometry::{Isometry3, Point3, Pose, UnitQuaternion, Vector3};
use georeference::{AntennaPosition, Gauge, PoseGraph, RelativePose, Solution, UpDirection};
use nalgebra::{Matrix6, Vector6};

/// Submaps of a round of 1.5 km.
const N: usize = 75;

/// The generator with which the bounds below were measured (Knuth, MMIX).
struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        Self(seed)
    }
    /// Uniform in `[0, 1)`.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Mean 0, variance 1: the sum of twelve uniform numbers.
fn gauss(random: &mut Random) -> f64 {
    (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
}

fn vector(random: &mut Random, sigma: f64) -> Vector3<f64> {
    Vector3::new(gauss(random), gauss(random), gauss(random)) * sigma
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
    let m = sigma_m.powi(-2);
    let rad = sigma_rad.powi(-2);
    Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad))
}

/// Odometry that drifts by 0.4 %, and its poses.
fn odometry(truth: &[Pose], random: &mut Random) -> (PoseGraph, Vec<Pose>) {
    let mut graph = PoseGraph::default();
    let mut poses = vec![truth[0]];
    for source in 1..truth.len() {
        let target = source - 1;
        let error = Isometry3::new(vector(random, 0.03), vector(random, 0.002));
        let target_from_source = truth[target].inv_mul(&truth[source]) * error;
        graph.odometry.push(RelativePose { target, source, target_from_source, information: information(0.03, 0.002) });
        poses.push(poses[target] * target_from_source);
    }
    (graph, poses)
}

fn position(truth: &[Pose], submap: usize, error: Vector3<f64>) -> AntennaPosition {
    let p_in_submap = Point3::new(6.0, -0.5, 1.8);
    let p_in_world = truth[submap] * p_in_submap + error;
    AntennaPosition {
        submap,
        p_in_submap,
        p_in_world,
        sigma_m: [0.7, 0.7, 1.5],
        sigma_above_m: 1.5,
        share: 1.0,
        tolerance_m: 0.0,
    }
}

fn rmse(found: &[Pose], truth: &[Pose]) -> f64 {
    let squares: f64 =
        found.iter().zip(truth).map(|(a, b)| (a.translation.vector - b.translation.vector).norm_squared()).sum();
    (squares / truth.len() as f64).sqrt()
}

fn exact_loop(truth: &[Pose], target: usize, source: usize) -> RelativePose {
    let target_from_source = truth[target].inv_mul(&truth[source]);
    RelativePose { target, source, target_from_source, information: information(0.03, 0.001) }
}

#[test]
fn solve_with_exact_measurements_finds_the_truth_from_a_drifted_start() {
    let truth = truth();
    let mut random = Random::new(1);
    let (mut graph, drifted) = odometry(&truth, &mut random);
    for relative in &mut graph.odometry {
        relative.target_from_source = truth[relative.target].inv_mul(&truth[relative.source]);
    }
    graph.loops.push(exact_loop(&truth, 0, N));
    assert!(rmse(&drifted, &truth) > 0.5, "the start must have drifted");
    let solution = graph.solve(&drifted, Gauge::FirstPose).unwrap();
    assert!(rmse(&solution.poses, &truth) < 1e-5, "{} m", rmse(&solution.poses, &truth));
    assert!(solution.loop_weights[0] > 0.99);
}

#[test]
fn loop_closure_halves_the_drift_and_covariances_match_the_errors() {
    let truth = truth();
    let mut before = 0.0;
    let mut after = 0.0;
    let mut normalized = 0.0;
    for seed in 0..20 {
        let (mut graph, drifted) = odometry(&truth, &mut Random::new(seed));
        graph.loops.push(exact_loop(&truth, 0, N));
        let solution = graph.solve(&drifted, Gauge::FirstPose).unwrap();
        before += rmse(&drifted, &truth) / 20.0;
        after += rmse(&solution.poses, &truth) / 20.0;
        let end = truth[N].inv_mul(&solution.poses[N]);
        assert!(end.translation.vector.norm() < 0.1, "seed {seed}: the end is off by {end}");
        // The covariance is largest halfway: compare it with the errors there.
        let error = truth[N / 2].inv_mul(&solution.poses[N / 2]);
        let mut off = Vector6::zeros();
        off.fixed_rows_mut::<3>(0).copy_from(&error.translation.vector);
        off.fixed_rows_mut::<3>(3).copy_from(&error.rotation.scaled_axis());
        normalized += off.dot(&(solution.covariances[N / 2].try_inverse().unwrap() * off)) / 6.0 / 20.0;
    }
    assert!(after < 0.5 * before, "{before} m became {after} m");
    assert!((0.6..1.6).contains(&normalized), "squared errors are {normalized} times the covariance");
}

#[test]
fn outlying_loops_and_positions_are_rejected() {
    let truth = truth();
    let mut random = Random::new(7);
    let (mut graph, drifted) = odometry(&truth, &mut random);
    graph.loops.push(exact_loop(&truth, 0, N));
    graph.loops.push(exact_loop(&truth, 1, N - 1));
    // Two streets of similar appearance.
    graph.loops.push(RelativePose { target_from_source: Pose::identity(), ..exact_loop(&truth, 10, 50) });
    graph.loops.push(RelativePose { target_from_source: Pose::identity(), ..exact_loop(&truth, 12, 48) });
    // A quarter of the positions are reflections: consecutive, tens of metres off.
    let is_reflected = |k: usize| (20..30).contains(&k) || (55..64).contains(&k);
    for k in 0..=N {
        let error = if is_reflected(k) { Vector3::new(18.0, -25.0, 30.0) } else { Vector3::zeros() };
        graph.positions.push(position(&truth, k, vector(&mut random, 0.5) + error));
    }
    let solution = graph.solve(&drifted, Gauge::Positions).unwrap();
    let off = rmse(&solution.poses, &truth);
    assert!(off < 0.35, "{off} m");
    assert_eq!(solution.loop_weights.len(), 4);
    assert!(solution.loop_weights[..2].iter().all(|w| *w > 0.5), "{:?}", solution.loop_weights);
    assert!(solution.loop_weights[2..].iter().all(|w| *w < 0.01), "{:?}", solution.loop_weights);
    for (k, weight) in solution.position_weights.iter().enumerate() {
        assert_eq!(*weight < 0.25, is_reflected(k), "position {k} has weight {weight}");
    }
    assert_eq!(Solution::n_inliers(&solution.position_weights), N + 1 - 19);
    // Plain least squares is metres off.
    let mut all = graph.clone();
    for p in &mut all.positions {
        p.sigma_m = p.sigma_m.map(|s| s * 1e3);
        p.sigma_above_m *= 1e3;
    }
    all.loops.clear();
    all.odometry.iter_mut().for_each(|r| r.information *= 1e-6);
    let plain = all.solve(&drifted, Gauge::Positions).unwrap();
    assert!(rmse(&plain.poses, &truth) > 5.0 * off, "{}", rmse(&plain.poses, &truth));
}

#[test]
fn heights_raised_by_reflections_do_not_raise_the_trajectory() {
    let truth = truth();
    let mean_error_m = |sigma_above_m: f64| {
        let mut random = Random::new(11);
        let (mut graph, drifted) = odometry(&truth, &mut random);
        for k in 0..=N {
            // Two of three are some metres too high.
            let raised = if k % 3 == 0 { 0.0 } else { 2.0 * gauss(&mut random).abs() };
            let error = vector(&mut random, 0.3) + Vector3::z() * raised;
            graph.positions.push(AntennaPosition { sigma_above_m, ..position(&truth, k, error) });
        }
        let solution = graph.solve(&drifted, Gauge::Positions).unwrap();
        let off = |(found, pose): (&Pose, &Pose)| found.translation.z - pose.translation.z;
        solution.poses.iter().zip(&truth).map(off).sum::<f64>() / truth.len() as f64
    };
    let symmetric = mean_error_m(1.5);
    let asymmetric = mean_error_m(9.0);
    assert!(symmetric > 0.6, "reflections must matter: {symmetric} m");
    assert!(asymmetric.abs() < 0.3, "{asymmetric} m");
}

#[test]
fn gravity_corrects_the_tilt_and_keeps_position_and_heading() {
    let truth = truth();
    let mut random = Random::new(3);
    let (mut graph, drifted) = odometry(&truth, &mut random);
    for (submap, pose) in truth.iter().enumerate() {
        let up_in_submap = (pose.rotation.inverse() * Vector3::z() + vector(&mut random, 0.002)).normalize();
        graph.up_directions.push(UpDirection { submap, up_in_submap, sigma_rad: 0.003 });
    }
    // The odometry starts with a tilt of three degrees.
    let tilt = Isometry3::rotation(Vector3::new(0.05, -0.02, 0.0));
    let start: Vec<Pose> = drifted.iter().map(|pose| tilt * pose).collect();
    let solution = graph.solve(&start, Gauge::FirstPositionAndHeading).unwrap();
    let tilt_of = |a: &Pose, b: &Pose| {
        let up = |pose: &Pose| pose.rotation.inverse() * Vector3::z();
        up(a).angle(&up(b))
    };
    for (k, (found, pose)) in solution.poses.iter().zip(&truth).enumerate() {
        assert!(tilt_of(found, pose) < 0.006, "submap {k}: {} rad", tilt_of(found, pose));
    }
    assert!(tilt_of(&start[N], &truth[N]) > 0.03);
    assert!((solution.poses[0].translation.vector - start[0].translation.vector).norm() < 1e-6);
    let rotated = (start[0].rotation.inverse() * solution.poses[0].rotation).scaled_axis().z;
    assert!(rotated.abs() < 1e-6, "{rotated}");
}

#[test]
fn solve_without_poses_for_all_submaps_returns_none() {
    let truth = truth();
    let (graph, drifted) = odometry(&truth, &mut Random::new(5));
    assert_eq!(graph.solve(&[], Gauge::FirstPose), None);
    assert_eq!(graph.solve(&drifted[..10], Gauge::FirstPose), None, "measurements of missing submaps");
}

#[test]
fn saved_graph_solves_to_the_same_bits() {
    let truth = truth();
    let mut random = Random::new(9);
    let (mut graph, drifted) = odometry(&truth, &mut random);
    graph.loops.push(exact_loop(&truth, 2, N - 2));
    graph.positions.push(position(&truth, 3, vector(&mut random, 0.5)));
    let bytes = postcard::to_stdvec(&graph).unwrap();
    let again: PoseGraph = postcard::from_bytes(&bytes).unwrap();
    assert_eq!(graph.solve(&drifted, Gauge::FirstPose), again.solve(&drifted, Gauge::FirstPose));
}
