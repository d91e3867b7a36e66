//! IMLS-SLAM as published, on the synthetic drive.

use crate::support::world::Drive;
use geometry::Pose;
use registration::{
    Algorithm, ImlsOdometry, ImlsSettings, Odometry, OdometrySettings, OtherAlgorithmError, Registered,
    SelectedOdometry, Sweep, TimedPoint,
};

const STREET: Drive = Drive { speed: 10.0, noise_m: 0.02, ground_only: false };

fn odometry(drive: &Drive) -> ImlsOdometry {
    ImlsOdometry::new(OdometrySettings::default(), ImlsSettings::default(), drive.world_from_lidar(0.0))
}

fn register_all(odometry: &mut ImlsOdometry, sweeps: &[Sweep]) -> Vec<Registered> {
    sweeps.iter().flat_map(|sweep| odometry.register(sweep).unwrap()).collect()
}

fn sweeps(numbers: std::ops::Range<u32>) -> Vec<Sweep> {
    numbers.map(|number| STREET.sweep(number)).collect()
}

fn distance(a: &Pose, b: &Pose) -> f64 {
    (a.translation.vector - b.translation.vector).norm()
}

fn truth_at_end(sweep: &Registered) -> Pose {
    STREET.world_from_lidar((sweep.stamp.0 + i64::from(sweep.duration_nanos)) as f64 * 1e-9)
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn imls_on_street_at_10_mps_follows_the_truth() {
    let registered = register_all(&mut odometry(&STREET), &sweeps(0..25));
    assert_eq!(registered.len(), 25);
    assert!(registered.iter().all(|sweep| !sweep.is_bridged() && !sweep.map_restarted));
    for (number, sweep) in registered.iter().enumerate() {
        let truth = truth_at_end(sweep);
        let off = distance(&sweep.end(), &truth);
        let path = number as f64;
        let turned = sweep.end().rotation.angle_to(&truth.rotation);
        println!("sweep {number}: {off:.3} m, {turned:.4} rad off");
        assert!(off < 0.03 + 0.005 * path, "sweep {number}: {off} m off");
        assert!(turned < 0.02, "sweep {number}: {turned} rad off");
    }
    let last = registered[24].matched.as_ref().unwrap();
    assert_eq!(last.n_features, 900, "nine lists of 100 samples");
    assert_eq!(last.n_degenerate_directions, 0);
    // The covariance grows with the drift.
    let deviation = |sweep: &Registered| sweep.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
    assert!(deviation(&registered[24]) > deviation(&registered[5]) && deviation(&registered[24]) < 0.5);
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn imls_without_point_times_has_twice_the_error() {
    let timed = sweeps(0..20);
    let untimed = |sweep: &Sweep| {
        let points = sweep.points().iter().map(|point| TimedPoint { offset_nanos: 0, ..*point }).collect();
        Sweep::new(sweep.stamp().plus_nanos(i64::from(sweep.duration_nanos())), points, 32)
    };
    let rigid: Vec<Sweep> = timed.iter().map(untimed).collect();
    let error = |sweeps: &[Sweep]| {
        let registered = register_all(&mut odometry(&STREET), sweeps);
        let moved = registered[2].end().inverse() * registered[19].end();
        distance(&moved, &(truth_at_end(&registered[2]).inverse() * truth_at_end(&registered[19])))
    };
    let with = error(&timed);
    let without = error(&rigid);
    assert!(without > 2.0 * with, "with point times {with} m, without {without} m");
}

#[test]
fn imls_model_keeps_all_points_of_the_set_number_of_sweeps() {
    let settings = ImlsSettings { sweeps: 3, ..ImlsSettings::default() };
    let mut odometry = ImlsOdometry::new(OdometrySettings::default(), settings, STREET.world_from_lidar(0.0));
    let mut sizes = Vec::new();
    for sweep in sweeps(0..7) {
        odometry.register(&sweep).unwrap();
        sizes.push(odometry.model_len());
    }
    let a_sweep = STREET.sweep(3).points().len();
    assert!(sizes[0] == 0 && sizes[1] * 10 > a_sweep * 17, "two sweeps, not thinned: {sizes:?}, {a_sweep} a sweep");
    assert!(sizes[6] * 10 > a_sweep * 24 && sizes[6] <= 3 * a_sweep, "three sweeps: {sizes:?}, {a_sweep} a sweep");
}

#[test]
fn imls_results_do_not_depend_on_the_number_of_threads() {
    let sweeps = sweeps(0..5);
    let on_threads = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| register_all(&mut odometry(&STREET), &sweeps))
    };
    assert_eq!(on_threads(1), on_threads(3));
}

#[test]
fn loaded_imls_continues_with_the_same_bits() {
    let sweeps = sweeps(0..7);
    let uninterrupted = register_all(&mut odometry(&STREET), &sweeps);
    for stop in [0, 1, 2, 5] {
        let mut first = odometry(&STREET);
        let mut registered = register_all(&mut first, &sweeps[..stop]);
        let saved = postcard::to_stdvec(&first.save()).unwrap();
        let settings = (OdometrySettings::default(), ImlsSettings::default());
        let mut second = ImlsOdometry::load(settings.0, settings.1, postcard::from_bytes(&saved).unwrap());
        registered.extend(register_all(&mut second, &sweeps[stop..]));
        assert_eq!(registered, uninterrupted, "stopped after {stop}");
        let states = [first, second].map(|odometry| odometry.model_len());
        assert!(states[0] <= states[1]);
    }
}

#[test]
fn imls_without_points_keeps_the_motion_and_then_begins_a_new_model() {
    let mut all = sweeps(0..16);
    for sweep in &mut all[6..12] {
        *sweep = Sweep::new(sweep.stamp(), Vec::new(), 32);
    }
    let registered = register_all(&mut odometry(&STREET), &all);
    let bridged: Vec<usize> = (0..16).filter(|&number| registered[number].is_bridged()).collect();
    assert!(bridged.starts_with(&[6, 7, 8, 9, 10, 11]), "{bridged:?}");
    let restarted: Vec<usize> = (0..16).filter(|&number| registered[number].map_restarted).collect();
    assert!(
        restarted == [12] || !bridged.contains(&12),
        "a new model with the first points: {restarted:?}, {bridged:?}"
    );
    assert!(bridged.iter().all(|&number| number <= 12), "matched again: {bridged:?}");
}

#[test]
fn state_of_another_odometry_is_rejected() {
    let begin = STREET.world_from_lidar(0.0);
    let imls = || Algorithm::Imls(ImlsSettings::default());
    let state = |algorithm| SelectedOdometry::new(OdometrySettings::default(), algorithm, begin).save();
    let load = |algorithm, state| SelectedOdometry::load(OdometrySettings::default(), algorithm, state);
    assert_eq!(load(imls(), state(Algorithm::ScanToMap)).err(), Some(OtherAlgorithmError));
    assert_eq!(load(Algorithm::ScanToMap, state(imls())).err(), Some(OtherAlgorithmError));
    assert!(load(imls(), state(imls())).is_ok());
}

#[test]
fn selected_default_gives_the_bits_of_the_default() {
    let sweeps = sweeps(0..4);
    let begin = STREET.world_from_lidar(0.0);
    let mut plain = Odometry::new(OdometrySettings::default(), begin);
    let mut selected = SelectedOdometry::new(OdometrySettings::default(), Algorithm::ScanToMap, begin);
    for sweep in &sweeps {
        assert_eq!(plain.register(sweep).unwrap(), selected.register(sweep).unwrap());
    }
}
