//! Another sensor's motion where the scene tells nothing.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

mod support;

use nalgebra::{Matrix6, Vector6};
use registration::{MeasuredMotion, Odometry, OdometrySettings, Registered, Velocity};
use support::world::Drive;

/// Bare ground from the first shot on: way and heading cannot be told.
const PLAIN: Drive = Drive { speed: 10.0, noise_m: 0.02, ground_only: true };
const N_SWEEPS: u32 = 12;

/// The true motion between the middles of two sweeps, known to 0.1 m/s and 0.1 degrees/s.
fn measured(drive: &Drive, seconds: [f64; 2]) -> MeasuredMotion {
    let [from, to] = seconds.map(|at| drive.world_from_lidar(at));
    let variances = Vector6::new(0.01, 0.01, 0.01, 3e-6, 3e-6, 3e-6);
    let velocity = Velocity::between(&from, &to, seconds[1] - seconds[0]);
    MeasuredMotion { velocity, covariance: Matrix6::from_diagonal(&variances) }
}

/// Way that was found, m, and the last sweep.
fn drive(is_measured: bool) -> (f64, Registered) {
    let mut odometry = Odometry::new(OdometrySettings::default(), PLAIN.world_from_lidar(0.0));
    let mut registered = Vec::new();
    let mut last_mid = None;
    for number in 0..N_SWEEPS {
        let sweep = PLAIN.sweep(number);
        let mid = sweep.mid_stamp().0 as f64 * 1e-9;
        let motion = last_mid.map(|last| measured(&PLAIN, [last, mid])).filter(|_| is_measured);
        registered.extend(odometry.register_with(&sweep, motion.as_ref()).unwrap());
        last_mid = Some(mid);
    }
    let way = registered[0].motion.mid.translation.vector - registered.last().unwrap().motion.mid.translation.vector;
    (way.norm(), registered.pop().unwrap())
}

#[test]
fn on_a_plain_the_way_is_the_measured_one_and_without_it_the_covariance_says_that_it_is_not_known() {
    let seconds = |number: u32| (f64::from(number) + 0.5) * 0.1;
    let ends = [0, N_SWEEPS - 1].map(|number| PLAIN.world_from_lidar(seconds(number)).translation.vector);
    let way = (ends[1] - ends[0]).norm();
    let (led, leaning) = drive(true);
    let (alone, guessing) = drive(false);
    println!("way {way:.3} m, led {led:.3} m, alone {alone:.3} m");
    assert!((led / way - 1.0).abs() < 0.02, "{led} m of {way} m");
    assert!((alone / way - 1.0).abs() > 0.2, "{alone} m of {way} m: the ground alone tells nothing");
    let deviation = |registered: &Registered| registered.covariance[(0, 0)].sqrt();
    // Eleven steps that are known to 1 cm each, and eleven tenths of a second at a speed of which nothing is known.
    assert!((0.02..0.06).contains(&deviation(&leaning)), "{}", deviation(&leaning));
    assert!(deviation(&guessing) > 5.0, "{}", deviation(&guessing));
    let height = guessing.covariance[(2, 2)].sqrt();
    assert!(height < 1.0, "the height is seen: {height}");
}
