//! Live heap bytes of the odometry over a drive back and forth. The test is a separate program because it counts all
//! allocations.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

#[path = "../suite/support/world.rs"]
#[allow(dead_code, reason = "the tests of the odometry use more of it")]
mod world;

use cap::Cap;
use geometry::{Isometry3, Pose, Stamp, Vector3};
use registration::{Odometry, OdometrySettings, Sweep};
use std::alloc::System;
use world::{Drive, body_from_lidar};

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

const STREET: Drive = Drive { speed: 0.0, noise_m: 0.02, ground_only: false };
/// Sweeps of one drive back and forth: more than the map holds.
const N_PERIOD: u32 = 80;
const AMPLITUDE_M: f64 = 6.0;
const N_PERIODS: i64 = 6;
/// Heap bytes for each point of the map of smooth surfaces: 190 in this street, most of them for blocks of 16 points
/// that are not full; includes the map of rough surfaces and the ranges of the last sweeps.
const MAX_BYTES_PER_POINT: usize = 240;
/// Largest growth from one period to the next ones, bytes, in addition to the growth by points: the noise of the poses
/// moves some points into other cells. A leak of 100 bytes per sweep is 32 kB.
const SLACK: usize = 20_000;

/// A drive to a place 12 m ahead and back, in 8 s.
fn world_from_lidar(second: f64) -> Pose {
    let angle = second / (f64::from(N_PERIOD) * 0.1) * std::f64::consts::TAU;
    let x = AMPLITUDE_M * (1.0 - angle.cos());
    Isometry3::from_parts(Vector3::new(x, 0.0, 0.0).into(), geometry::UnitQuaternion::identity()) * body_from_lidar()
}

#[test]
fn odometry_that_passes_the_same_street_again_keeps_no_more_memory() {
    let sweeps: Vec<Sweep> = (0..N_PERIOD).map(|number| STREET.sweep_at(&world_from_lidar, number)).collect();
    let period = sweeps[1].stamp().0 * i64::from(N_PERIOD);
    let begin = MEMORY.allocated();
    let mut odometry = Odometry::new(OdometrySettings::default(), world_from_lidar(0.0));
    let mut live = |number: i64| {
        for sweep in &sweeps {
            let stamp = Stamp(sweep.stamp().0 + number * period);
            let registered = odometry.register(&Sweep::new(stamp, sweep.points().to_vec(), 32)).unwrap();
            assert!(registered.iter().all(|registered| !registered.is_bridged()));
        }
        (odometry.map().len(), MEMORY.allocated() - begin)
    };
    let live: Vec<(usize, usize)> = (0..N_PERIODS).map(&mut live).collect();
    // In the second period the map is full.
    let (n_points, n_bytes) = live[1];
    for (points, bytes) in &live {
        assert!(*bytes < MAX_BYTES_PER_POINT * points, "points and bytes {live:?}");
        let by_points = MAX_BYTES_PER_POINT * points.saturating_sub(n_points);
        assert!(*bytes < n_bytes + by_points + SLACK, "points and bytes {live:?}");
    }
    println!("points and bytes {live:?}");
}
