//! A synthetic drive with ground truth: 32 beams tilted by 30 degrees, moving from the first shot on.

use crate::support::world::{Drive, body_from_lidar};
use geometry::{Isometry3, Pose, Stamp};
use registration::{
    MatchSettings, Odometry, OdometrySettings, Registered, RegistrationError, SpinDirection, Sweep, TimedPoint,
};

const STREET: Drive = Drive { speed: 10.0, noise_m: 0.02, ground_only: false };

fn odometry(drive: &Drive) -> Odometry {
    Odometry::new(OdometrySettings::default(), drive.world_from_lidar(0.0))
}

fn register_all(odometry: &mut Odometry, sweeps: &[Sweep]) -> Vec<Registered> {
    sweeps.iter().flat_map(|sweep| odometry.register(sweep).unwrap()).collect()
}

fn sweeps_of(drive: &Drive, numbers: std::ops::Range<u32>) -> Vec<Sweep> {
    numbers.map(|number| drive.sweep(number)).collect()
}

fn truth_at(drive: &Drive, sweep: &Registered, share: f64) -> Pose {
    drive.world_from_lidar(sweep.stamp.0 as f64 * 1e-9 + share * f64::from(sweep.duration_nanos) * 1e-9)
}

fn distance(a: &Pose, b: &Pose) -> f64 {
    (a.translation.vector - b.translation.vector).norm()
}

/// Error of the motion between the middles of two sweeps, m.
fn motion_error(drive: &Drive, from: &Registered, to: &Registered) -> f64 {
    let found = from.motion.mid.inverse() * to.motion.mid;
    let expected = truth_at(drive, from, 0.5).inverse() * truth_at(drive, to, 0.5);
    distance(&found, &expected)
}

#[test]
fn street_at_10_mps_is_tracked_from_the_first_shot() {
    let sweeps = sweeps_of(&STREET, 0..50);
    let registered = register_all(&mut odometry(&STREET), &sweeps);
    assert_eq!(registered.len(), sweeps.len());
    assert!(registered.iter().all(|sweep| !sweep.is_bridged()));
    assert!(distance(&registered[0].begin(), &STREET.world_from_lidar(0.0)) < 1e-9, "begins at the given pose");
    let mut path = 0.0;
    for (sweep, raw) in registered.iter().zip(&sweeps) {
        assert_eq!((sweep.stamp, sweep.duration_nanos), (raw.stamp(), raw.duration_nanos()));
        let begin = truth_at(&STREET, sweep, 0.0);
        let end = truth_at(&STREET, sweep, 1.0);
        path += distance(&begin, &end);
        let moved_off = distance(&(sweep.begin().inverse() * sweep.end()), &(begin.inverse() * end));
        assert!(moved_off < 0.04, "motion during the sweep is {moved_off} m off, of 1 m");
        let off = distance(&sweep.end(), &end);
        assert!(off < 0.03 + 0.005 * path, "{off} m off after {path} m");
        assert!(sweep.motion.mid.rotation.angle_to(&truth_at(&STREET, sweep, 0.5).rotation) < 0.01);
    }
    assert!(path > 45.0, "{path}");
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn sweeps_without_point_times_have_three_times_the_error() {
    let sweeps = sweeps_of(&STREET, 0..30);
    let untimed = |sweep: &Sweep| {
        let points = sweep.points().iter().map(|point| TimedPoint { offset_nanos: 0, ..*point }).collect();
        Sweep::new(sweep.stamp().plus_nanos(i64::from(sweep.duration_nanos()) / 2), points, 32)
    };
    let rigid: Vec<Sweep> = sweeps.iter().map(untimed).collect();
    let deskewed = register_all(&mut odometry(&STREET), &sweeps);
    let skewed = register_all(&mut odometry(&STREET), &rigid);
    let error = |registered: &[Registered]| motion_error(&STREET, &registered[2], &registered[29]);
    let with = error(&deskewed);
    let without = error(&skewed);
    println!("with point times {with:.3} m, without {without:.3} m");
    assert!(without > 3.0 * with, "with point times {with} m, without {without} m");
}

/// Revolutions from rear to rear, with the times of their points.
fn from_rear_to_rear(sweeps: &[Sweep]) -> Vec<Sweep> {
    let join = |pair: &[Sweep]| {
        let begin = i64::from(pair[0].duration_nanos()) / 2;
        let shift = pair[1].stamp().0 - pair[0].stamp().0 - begin;
        let moved = |sweep: &Sweep, by: i64, is_in: fn(&TimedPoint) -> bool| -> Vec<TimedPoint> {
            let moved =
                |point: &TimedPoint| TimedPoint { offset_nanos: (i64::from(point.offset_nanos) + by) as u32, ..*point };
            sweep.points().iter().filter(|point| is_in(point)).map(moved).collect()
        };
        // Sensors spin clockwise from ahead: to the right, then to the left.
        let mut points = moved(&pair[0], -begin, |point| point.position[1] > 0.0);
        points.extend(moved(&pair[1], shift, |point| point.position[1] <= 0.0));
        points.retain(|point| point.offset_nanos < 110_000_000);
        Sweep::new(pair[0].stamp().plus_nanos(begin), points, 32)
    };
    sweeps.windows(2).map(join).collect()
}

/// The LiDAR is upright: the spin direction is estimated about the vertical.
#[test]
#[ignore = "long: .ci/run --nightly"]
fn sense_of_turning_is_found_in_sweeps_without_times_and_not_in_deskewed_ones() {
    let world_from_lidar = |t: f64| STREET.world_from_body(t) * Isometry3::translation(0.3, 0.0, 2.1);
    let sweeps: Vec<Sweep> = (0..41).map(|number| STREET.sweep_at(&world_from_lidar, number)).collect();
    let timed = from_rear_to_rear(&sweeps);
    let settings = OdometrySettings { untimed_turn_s: Some(0.1), ..OdometrySettings::default() };
    let found = |rigid: &dyn Fn(&Sweep, &TimedPoint) -> [f32; 3]| {
        let mut odometry = Odometry::new(settings.clone(), world_from_lidar(0.05));
        for sweep in &timed {
            let points = sweep.points().iter();
            let points = points.map(|p| TimedPoint { position: rigid(sweep, p), offset_nanos: 0, ..*p }).collect();
            odometry.register(&Sweep::new(sweep.stamp(), points, 32)).unwrap();
            if odometry.turning().is_some() {
                break;
            }
        }
        odometry.turning()
    };
    let deskewed = |sweep: &Sweep, point: &TimedPoint| {
        let at = |nanos: u32| world_from_lidar((sweep.stamp().0 + i64::from(nanos)) as f64 * 1e-9);
        let middle = at(sweep.duration_nanos() / 2);
        let position = middle.inverse() * at(point.offset_nanos) * geometry::Point3::from(point.position).cast::<f64>();
        position.coords.cast::<f32>().into()
    };
    let mirrored = |[x, y, z]: [f32; 3]| [x, -y, z];
    assert_eq!(found(&|_, point| point.position), Some(SpinDirection::Clockwise));
    assert_eq!(found(&|_, point| mirrored(point.position)), Some(SpinDirection::Counterclockwise));
    assert_eq!(found(&deskewed), None);
}

#[test]
fn standing_vehicle_does_not_drift_and_its_map_does_not_age() {
    let drive = Drive { speed: 0.0, ..STREET };
    let begin = drive.world_from_lidar(0.0);
    let sweeps: Vec<Sweep> = (0..80).map(|number| drive.sweep_at(&|_| begin, number)).collect();
    let mut odometry = odometry(&drive);
    let registered = register_all(&mut odometry, &sweeps);
    for sweep in &registered {
        assert!(distance(&sweep.motion.mid, &begin) < 0.015, "noise must not move it");
        assert!(distance(&sweep.end(), &begin) < 0.025);
    }
    let drift = distance(&registered[79].motion.mid, &registered[40].motion.mid);
    assert!(drift < 0.015, "{drift} m in four seconds");
    let points = odometry.map().points();
    assert!(points.len() > 1000 && points.iter().all(|point| point.batch == 0), "{}", points.len());
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let sweeps = sweeps_of(&STREET, 0..6);
    let on_threads = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| register_all(&mut odometry(&STREET), &sweeps))
    };
    assert_eq!(on_threads(1), on_threads(3));
}

#[test]
fn loaded_odometry_continues_with_the_same_bits() {
    let sweeps = sweeps_of(&STREET, 0..8);
    let uninterrupted = register_all(&mut odometry(&STREET), &sweeps);
    for stop in [0, 1, 2, 5] {
        let mut first = odometry(&STREET);
        let mut registered = register_all(&mut first, &sweeps[..stop]);
        let saved = postcard::to_stdvec(&first.save()).unwrap();
        assert!(saved.len() < 4_000_000, "{} bytes", saved.len());
        let mut second = Odometry::load(OdometrySettings::default(), postcard::from_bytes(&saved).unwrap());
        registered.extend(register_all(&mut second, &sweeps[stop..]));
        assert_eq!(registered, uninterrupted, "stopped after {stop}");
    }
}

#[test]
fn sweeps_without_features_are_bridged_and_reported() {
    let mut sweeps = sweeps_of(&STREET, 0..16);
    for number in [8, 9] {
        // Fog: only the road right below is visible.
        let few = sweeps[number]
            .points()
            .iter()
            .filter(|p| nalgebra::Vector3::from(p.position).norm() < 2.4)
            .copied()
            .collect();
        sweeps[number] = Sweep::new(sweeps[number].stamp(), few, 32);
    }
    sweeps[12] = Sweep::new(sweeps[12].stamp(), Vec::new(), 32);
    let registered = register_all(&mut odometry(&STREET), &sweeps);
    let bridged: Vec<usize> = (0..16).filter(|&number| registered[number].is_bridged()).collect();
    assert_eq!(bridged, [8, 9, 12]);
    for sweep in &registered {
        let off = distance(&sweep.end(), &truth_at(&STREET, sweep, 1.0));
        assert!(off < 0.15, "{off} m");
    }
    assert!(distance(&registered[15].end(), &truth_at(&STREET, &registered[15], 1.0)) < 0.08, "recovered");
}

/// Regression: a match that ran out of rounds with an error of centimetres was accepted and distorted the map
/// permanently.
#[test]
fn match_that_has_not_converged_is_rejected() {
    let mut sweeps = sweeps_of(&STREET, 0..8);
    // 0.7 s are missing in a bend.
    sweeps.extend(sweeps_of(&STREET, 15..16));
    let last_of = |max_rounds: u32| {
        let settings = MatchSettings { max_rounds, ..MatchSettings::default() };
        let settings = OdometrySettings { matching: settings, ..OdometrySettings::default() };
        let mut odometry = Odometry::new(settings, STREET.world_from_lidar(0.0));
        register_all(&mut odometry, &sweeps).remove(8)
    };
    assert!(last_of(1).is_bridged(), "one round is not enough");
    let found = last_of(MatchSettings::default().max_rounds);
    assert!(found.matched.as_ref().is_some_and(|matched| matched.converged));
    let off = distance(&found.end(), &truth_at(&STREET, &found, 1.0));
    assert!(off < 0.05, "{off} m");
}

#[test]
fn lost_map_is_restarted_and_reported() {
    let mut sweeps = sweeps_of(&STREET, 0..6);
    // Two seconds later, another part of the road: the old map is out of reach.
    let jump = |number: u32| {
        let sweep = Drive { speed: -4.0, ..STREET }.sweep(number);
        Sweep::new(sweep.stamp().plus_nanos(2_000_000_000), sweep.points().to_vec(), 32)
    };
    sweeps.extend((6..20).map(jump));
    let registered = register_all(&mut odometry(&STREET), &sweeps);
    let restarts = registered.iter().filter(|sweep| sweep.map_restarted).count();
    assert!(restarts >= 1, "no restart");
    assert!(registered.iter().all(|sweep| !sweep.map_restarted || sweep.is_bridged()));
}

#[test]
fn bare_ground_keeps_position_and_heading_at_the_prediction() {
    let mut sweeps = sweeps_of(&STREET, 0..10);
    sweeps.extend(sweeps_of(&Drive { ground_only: true, ..STREET }, 10..18));
    let registered = register_all(&mut odometry(&STREET), &sweeps);
    for sweep in &registered[..10] {
        assert_eq!(sweep.matched.as_ref().unwrap().n_degenerate_directions, 0);
    }
    for sweep in &registered[10..] {
        let matched = sweep.matched.as_ref().unwrap();
        assert_eq!(matched.n_degenerate_directions, 3, "forward, sideways, heading: {matched:?}");
        let found = sweep.motion.mid;
        let truth = truth_at(&STREET, sweep, 0.5);
        assert!((found.translation.z - truth.translation.z).abs() < 0.03, "the height is measured");
        assert!(distance(&found, &truth) < 0.5, "the position is predicted");
    }
}

#[test]
fn sweeps_out_of_order_are_rejected() {
    let sweeps = sweeps_of(&STREET, 0..3);
    let mut odometry = odometry(&STREET);
    register_all(&mut odometry, &sweeps[..2]);
    let last = sweeps[1].mid_stamp();
    let got = sweeps[0].mid_stamp();
    assert_eq!(odometry.register(&sweeps[0]), Err(RegistrationError::Order { last, got }));
    assert_eq!(odometry.register(&sweeps[2]).unwrap().len(), 1, "the odometry continues");
}

#[test]
fn single_sweep_is_at_rest() {
    let mut odometry = Odometry::new(OdometrySettings::default(), body_from_lidar());
    assert_eq!(odometry.register(&STREET.sweep(0)).unwrap(), []);
    let lone = odometry.finish().unwrap();
    assert!(lone.is_bridged());
    assert_eq!((lone.stamp, lone.begin(), lone.end()), (Stamp(0), body_from_lidar(), body_from_lidar()));
    assert_eq!(odometry.finish(), None);
}
