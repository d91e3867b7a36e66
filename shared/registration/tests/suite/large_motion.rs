//! Sweeps whose motion is beyond the search radius of a match: carried by hand, at 2 Hz, and from a start at speed.

use crate::support::world::Drive;
use geometry::{Isometry3, Pose, Stamp, UnitQuaternion, Vector3};
use registration::{Odometry, OdometrySettings, Registered, Sweep, TimedPoint};

const SWEEPS_OF_A_STEP: u32 = 5;

/// Errors of the step between two sweeps.
#[derive(Debug)]
struct StepError {
    shift_m: f64,
    turn_rad: f64,
}

fn step_errors(registered: &[Registered], truth: impl Fn(&Registered) -> Pose) -> Vec<StepError> {
    let error = |pair: &[Registered]| {
        let found = pair[0].motion.mid.inverse() * pair[1].motion.mid;
        let expected = truth(&pair[0]).inverse() * truth(&pair[1]);
        StepError {
            shift_m: (found.translation.vector - expected.translation.vector).norm(),
            turn_rad: found.rotation.angle_to(&expected.rotation),
        }
    };
    registered.windows(2).map(error).collect()
}

fn register_all(first: Pose, sweeps: &[Sweep]) -> Vec<Registered> {
    let mut odometry = Odometry::new(OdometrySettings::default(), first);
    sweeps.iter().flat_map(|sweep| odometry.register(sweep).unwrap()).collect()
}

/// A person who walks at 1.2 m/s and turns by up to 45 degrees between two sweeps, half a second apart. Each sweep is rigid.
#[test]
fn turns_of_45_degrees_between_sweeps_are_found() {
    const TURNS_DEG: [f64; 16] =
        [0.0, 30.0, 45.0, -20.0, -45.0, -15.0, 10.0, 40.0, 40.0, -30.0, -45.0, 0.0, 25.0, -45.0, 35.0, -12.0];
    let street = Drive { speed: 0.0, noise_m: 0.02, ground_only: false };
    let poses: Vec<Pose> = TURNS_DEG
        .iter()
        .scan(0.0_f64, |heading, turn| {
            *heading += turn.to_radians();
            Some(*heading)
        })
        .zip(0..)
        .map(|(heading, number)| {
            let rotation = UnitQuaternion::from_euler_angles(0.0, 0.02 * f64::from(number % 3), heading);
            Isometry3::from_parts(Vector3::new(10.0 + 0.6 * f64::from(number), 0.5, 1.6).into(), rotation)
        })
        .collect();
    let sweep = |(pose, number): (&Pose, u32)| {
        let timed = street.sweep_at(&|_| *pose, number * SWEEPS_OF_A_STEP);
        let points = timed.points().iter().map(|point| TimedPoint { offset_nanos: 0, ..*point }).collect();
        Sweep::new(Stamp(i64::from(number) * 500_000_000), points, 32)
    };
    let sweeps: Vec<Sweep> = poses.iter().zip(0..).map(sweep).collect();
    let registered = register_all(poses[0], &sweeps);
    assert!(registered.iter().all(|sweep| !sweep.is_bridged()));
    let errors = step_errors(&registered, |sweep| poses[(sweep.stamp.0 / 500_000_000) as usize]);
    assert_eq!(errors.len(), TURNS_DEG.len() - 1);
    for error in &errors {
        assert!(error.shift_m < 0.1 && error.turn_rad < 0.01, "{errors:?}");
    }
}

/// Each fifth sweep of a car that already drives at 10 m/s: 5 m between the first two sweeps.
#[test]
fn start_at_speed_with_sweeps_at_2_hz_is_found() {
    let street = Drive { speed: 10.0, noise_m: 0.02, ground_only: false };
    let sweeps: Vec<Sweep> = (0..60).step_by(SWEEPS_OF_A_STEP as usize).map(|number| street.sweep(number)).collect();
    let registered = register_all(street.world_from_lidar(0.0), &sweeps);
    let truth = |sweep: &Registered| {
        let mid_s = sweep.stamp.0 as f64 * 1e-9 + 0.5 * f64::from(sweep.duration_nanos) * 1e-9;
        street.world_from_lidar(mid_s)
    };
    let errors = step_errors(&registered, truth);
    assert_eq!(errors.len(), sweeps.len() - 1);
    for error in &errors {
        assert!(error.shift_m < 0.2 && error.turn_rad < 0.01745, "{errors:?}");
    }
}
