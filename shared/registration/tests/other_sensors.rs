//! Inertial samples and a receiver's velocities where the scene tells nothing.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod support;

use geometry::{Pose, Stamp, UnitQuaternion, Vector3};
use registration::{GroundVelocity, InertialSample, Odometry, OdometrySettings, Registered, SensorPlaces, Sweep};
use support::world::{Drive, body_from_lidar};

/// Bare ground from the first shot on: way and heading cannot be told.
const PLAIN: Drive = Drive { speed: 10.0, noise_m: 0.02, ground_only: true };
const STREET: Drive = Drive { ground_only: false, ..PLAIN };
/// Of a sweep, with or without returns.
const SWEEP_NANOS: i64 = 100_000_000;
/// Biases of the inertial unit: 2 mg and 0.1 degrees/s.
const FORCE_BIAS: Vector3<f64> = Vector3::new(0.02, -0.01, 0.02);
const RATE_BIAS: Vector3<f64> = Vector3::new(0.0017, -0.001, 0.0015);

fn settings() -> OdometrySettings {
    let places = SensorPlaces { body_from_lidar: body_from_lidar(), ..SensorPlaces::default() };
    OdometrySettings { places, ..OdometrySettings::default() }
}

fn samples(drive: &Drive, seconds: f64) -> Vec<InertialSample> {
    let sample = |i: i64| {
        let (force, rate) = drive.felt(i as f64 * 0.01);
        InertialSample { stamp: Stamp(i * 10_000_000), force: force + FORCE_BIAS, rate: rate + RATE_BIAS }
    };
    (0..(seconds * 100.0) as i64).map(sample).collect()
}

/// Twice a second until a time in s, rounded to what a receiver writes.
fn velocities(drive: &Drive, until: f64) -> Vec<GroundVelocity> {
    let velocity = |i: i64| {
        let true_one = drive.velocity(i as f64 * 0.5);
        let course = true_one.x.atan2(true_one.y).to_degrees().rem_euclid(360.0);
        GroundVelocity::new(
            Stamp(i * 500_000_000),
            true_one.xy().norm(),
            Some((course * 100.0).round() / 100.0),
            Some(1.0),
        )
    };
    (0..(until * 2.0) as i64).filter_map(velocity).collect()
}

/// Registers sweeps with what other sensors measured until their last shots.
fn run(
    odometry: &mut Odometry,
    sweeps: &[Sweep],
    samples: &[InertialSample],
    velocities: &[GroundVelocity],
) -> Vec<Registered> {
    let (mut samples, mut velocities) = (samples.iter().peekable(), velocities.iter().peekable());
    let mut registered = Vec::new();
    for sweep in sweeps {
        let end = sweep.stamp().plus_nanos(SWEEP_NANOS);
        std::iter::from_fn(|| samples.next_if(|sample| sample.stamp <= end)).for_each(|s| odometry.feel(*s));
        std::iter::from_fn(|| velocities.next_if(|velocity| velocity.stamp <= end)).for_each(|v| odometry.hear(*v));
        registered.extend(odometry.register(sweep).unwrap());
    }
    registered
}

fn drive(drive: &Drive, n_sweeps: u32, samples: &[InertialSample], velocities: &[GroundVelocity]) -> Vec<Registered> {
    let sweeps: Vec<Sweep> = (0..n_sweeps).map(|number| drive.sweep(number)).collect();
    run(&mut Odometry::new(settings(), drive.world_from_lidar(0.0)), &sweeps, samples, velocities)
}

/// Error of the last pose, and what it says of itself along the road, m.
fn error(drive: &Drive, registered: &[Registered]) -> (Vector3<f64>, f64) {
    let last = registered.last().unwrap();
    let mid = (last.stamp.0 + i64::from(last.duration_nanos) / 2) as f64 * 1e-9;
    let off = last.motion.mid.translation.vector - drive.world_from_lidar(mid).translation.vector;
    (off, last.covariance[(0, 0)].sqrt())
}

#[test]
fn on_bare_ground_samples_and_velocities_tell_the_way() {
    let registered = drive(&PLAIN, 20, &samples(&PLAIN, 3.0), &velocities(&PLAIN, 3.0));
    let (off, deviation) = error(&PLAIN, &registered);
    assert!(registered[1..].iter().all(|sweep| sweep.lean.inertial && sweep.lean.receiver));
    // Two seconds and 20 m: 0.28 m were measured, two of its deviations of 0.14 m. Three are 0.42 m.
    assert!(off.norm() < 0.4 && off.norm() < 3.0 * deviation, "{off}, said to be {deviation}");
    assert!(deviation < 0.5, "{deviation}");
    let alone = drive(&PLAIN, 20, &[], &[]);
    let (off, deviation) = error(&PLAIN, &alone);
    assert!(off.norm() > 4.0 && deviation > 5.0, "the ground alone tells nothing: {off}, said to be {deviation}");
    // The ground is seen, and a road may climb or fall by a tenth of the way that is not known.
    let covariance = &alone.last().unwrap().covariance;
    let by_grade = 0.01 * (covariance[(0, 0)] + covariance[(1, 1)]);
    assert!((covariance[(2, 2)] - by_grade).sqrt() < 1.0, "the height is seen");
    assert!(alone.iter().all(|sweep| !sweep.lean.inertial && !sweep.lean.receiver));
}

#[test]
fn when_velocities_cease_samples_go_on_and_the_covariance_grows() {
    let samples = samples(&PLAIN, 4.0);
    let with = drive(&PLAIN, 38, &samples, &velocities(&PLAIN, 4.0));
    let without = drive(&PLAIN, 38, &samples, &velocities(&PLAIN, 1.6));
    assert_eq!(with[..14], without[..14]);
    let [(_, known), (off, guessed)] = [&with, &without].map(|registered| error(&PLAIN, registered));
    assert!(guessed > 1.2 * known, "{guessed} {known}");
    assert!(off.norm() < 1.0 && off.norm() < 3.0 * guessed, "{off}, said to be {guessed}");
    assert!(!without.last().unwrap().lean.receiver && without.last().unwrap().lean.inertial);
}

#[test]
fn a_velocity_off_a_wall_is_refused() {
    let (samples, mut velocities) = (samples(&PLAIN, 3.0), velocities(&PLAIN, 3.0));
    let before = error(&PLAIN, &drive(&PLAIN, 20, &samples, &velocities)).0;
    velocities[2].east_north = [-30.0, 12.0];
    let after = error(&PLAIN, &drive(&PLAIN, 20, &samples, &velocities)).0;
    // One speed of four is missing: 0.27 m were measured, as much as the way with all of them is off.
    assert!((after - before).norm() < 0.4, "{before} {after}");
}

#[test]
fn sweeps_without_a_match_follow_the_samples() {
    // It speeds up by 1.8 m/s^2 while there is nothing to see.
    let fog = 72..76;
    let sweep = |number: u32| {
        if fog.contains(&number) {
            let seen = STREET.sweep(number);
            Sweep::new(seen.stamp(), Vec::new(), 32)
        } else {
            STREET.sweep(number)
        }
    };
    let sweeps: Vec<Sweep> = (60..76).map(sweep).collect();
    let begin = STREET.world_from_lidar(sweeps[0].stamp().0 as f64 * 1e-9);
    let by_samples = run(&mut Odometry::new(settings(), begin), &sweeps, &samples(&STREET, 8.0), &[]);
    let by_habit = run(&mut Odometry::new(settings(), begin), &sweeps, &[], &[]);
    let [(felt, deviation), (guessed, guess)] = [&by_samples, &by_habit].map(|registered| error(&STREET, registered));
    assert!(by_samples[12..].iter().all(|sweep| sweep.is_bridged() && sweep.lean.inertial));
    assert!(felt.norm() < 0.1 && felt.norm() < 0.5 * guessed.norm(), "{felt} {guessed}");
    assert!(deviation < guess, "{deviation} {guess}");
}

#[test]
fn a_start_in_a_turn_is_felt() {
    // On the spot, at 1.5 rad/s from the first shot on: the coarse search reaches 50 cm, 0.15 rad are 3 m at 20 m.
    let turn = |t: f64| Pose::from_parts(Vector3::zeros().into(), UnitQuaternion::from_euler_angles(0.0, 0.0, 1.5 * t));
    let at = |t: f64| turn(t) * body_from_lidar();
    let sweeps: Vec<Sweep> = (0..5).map(|number| STREET.sweep_at(&at, number)).collect();
    let sample = |i: i64| InertialSample {
        stamp: Stamp(i * 10_000_000),
        force: Vector3::z() * 9.806,
        rate: Vector3::z() * 1.5 + RATE_BIAS,
    };
    let samples: Vec<InertialSample> = (0..60).map(sample).collect();
    let registered = run(&mut Odometry::new(settings(), at(0.0)), &sweeps, &samples, &[]);
    let last = registered.last().unwrap();
    let mid = (last.stamp.0 + i64::from(last.duration_nanos) / 2) as f64 * 1e-9;
    let off = last.motion.mid.rotation.angle_to(&at(mid).rotation);
    assert!(registered.iter().all(|sweep| !sweep.is_bridged()) && off < 0.01, "{off} rad");
}

#[test]
fn a_saved_odometry_goes_on_as_if_nothing_had_happened() {
    let (samples, velocities) = (samples(&PLAIN, 2.0), velocities(&PLAIN, 2.0));
    let sweeps: Vec<Sweep> = (0..8).map(|number| PLAIN.sweep(number)).collect();
    let begin = PLAIN.world_from_lidar(0.0);
    let undisturbed = run(&mut Odometry::new(settings(), begin), &sweeps, &samples, &velocities);
    for stop in [1, 2, 5] {
        let mut first = Odometry::new(settings(), begin);
        let end = sweeps[stop - 1].stamp().plus_nanos(SWEEP_NANOS);
        let mut registered = run(&mut first, &sweeps[..stop], &samples, &velocities);
        let saved = postcard::to_stdvec(&first.save()).unwrap();
        let mut second = Odometry::load(settings(), postcard::from_bytes(&saved).unwrap());
        let rest = samples.partition_point(|sample| sample.stamp <= end);
        let rest_of_velocities = velocities.partition_point(|velocity| velocity.stamp <= end);
        registered.extend(run(&mut second, &sweeps[stop..], &samples[rest..], &velocities[rest_of_velocities..]));
        assert!(registered == undisturbed, "stopped after {stop}");
    }
}
