//! A drive of two minutes through curves: its true motion, odometry with drift, and fixes with any error.

use crate::gnss_row::gnss_row;
use crate::matched;
use geometry::{Geodetic, Isometry3, LocalFrame, Point3, Pose, Vector3};
use georeference::{GeoreferenceSettings, Georeferencer, Placed};
use messages::GnssRow;
use random::{gauss, hash};
use registration::{Registered, SweepMotion};

pub const SECONDS: i64 = 120;
pub const SWEEP_NANOS: i64 = 100_000_000;
const ANTENNA: [f64; 3] = [-1.2, 0.3, 1.75];
/// Drift of the heading of the odometry, rad/s: 0.2 degrees at the end.
const DRIFT_RAD_PER_S: f64 = 3e-5;

pub fn origin() -> Geodetic {
    Geodetic::new(48.846_222, 2.346_414, 104.6).unwrap()
}

pub fn settings() -> GeoreferenceSettings {
    GeoreferenceSettings {
        gnss: true,
        imu: false,
        loops: false,
        unsmooth_fixes: false,
        antenna_in_body: ANTENNA.into(),
        imu_in_body: Point3::origin(),
        origin: Some(origin()),
        max_keyframes: 10,
    }
}

/// `world_from_body`: 9 m/s with stops of some seconds, along curves.
pub fn truth(second: f64) -> Pose {
    let along = 9.0 * second + 20.0 * (second * 0.3).sin();
    let x = along;
    let y = 60.0 * (along / 90.0).sin();
    let yaw = (60.0 / 90.0 * (along / 90.0).cos()).atan();
    Isometry3::new(Vector3::new(40.0, -30.0, 5.0) + Vector3::new(x, y, 0.0), Vector3::z() * yaw)
}

fn odometry(second: f64) -> Pose {
    // The odometry frame has an arbitrary origin and heading.
    let odom_from_world = Isometry3::new(Vector3::new(3.0, 2.0, 0.0), Vector3::z() * 1.3) * truth(0.0).inverse();
    let truth = odom_from_world * truth(second);
    Isometry3::rotation(Vector3::z() * (DRIFT_RAD_PER_S * second)) * truth
}

pub fn noise(stream: u64, second: i64, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| sigma * f64::from(gauss(hash(hash(stream, second as u64), axis as u64))))
}

/// A fix of a receiver with corrections and exact velocities.
pub fn fix(second: i64, error: Vector3<f64>) -> GnssRow {
    let antenna = |second: f64| truth(second) * Point3::from(ANTENNA);
    let at = second as f64 + 0.05;
    let place = LocalFrame::new(origin()).geodetic_from_world(&(antenna(at) + error));
    let velocity = (antenna(at + 0.01) - antenna(at - 0.01)) / 0.02;
    gnss_row(at, &place, &velocity)
}

pub fn placed(fixes: impl Fn(i64) -> Option<GnssRow>) -> Placed {
    let settings = settings();
    let mut georeferencer = Georeferencer::new(&settings);
    for k in 0..SECONDS * 10 {
        let second = k as f64 * 0.1;
        if k % 10 == 0 {
            georeferencer.add_gnss(&fixes(k / 10).into_iter().collect::<Vec<_>>(), &settings);
        }
        let begin = odometry(second);
        let end = odometry(second + 0.1);
        if k % 25 == 0 {
            georeferencer.begin_submap(begin, k * SWEEP_NANOS);
        }
        georeferencer.add_sweep(&registered(k * SWEEP_NANOS, &begin, &end), &begin, &end);
        georeferencer.update(&settings);
    }
    georeferencer.solve(&settings).expect("has submaps")
}

pub fn registered(stamp: i64, begin: &Pose, end: &Pose) -> Registered {
    let translation = end.translation.vector - begin.translation.vector;
    let motion = SweepMotion { mid: *begin, translation, rotation: Vector3::zeros() };
    matched::registered(stamp, SWEEP_NANOS as u32, motion, 1000, false)
}

/// Root mean square errors of the submaps: horizontal and up, m, and heading, degrees.
pub fn errors(placed: &Placed) -> [f64; 3] {
    let mut squares = [0.0; 3];
    for row in &placed.rows {
        let pose: Pose = row.world_from_submap.to_pose().unwrap();
        let truth = truth(row.stamp as f64 * 1e-9);
        let off = pose.translation.vector - truth.translation.vector;
        let turned = (truth.rotation.inverse() * pose.rotation).scaled_axis().z.to_degrees();
        squares[0] += off.xy().norm_squared();
        squares[1] += off.z * off.z;
        squares[2] += turned * turned;
    }
    squares.map(|square| (square / placed.rows.len() as f64).sqrt())
}

/// Means of the reported standard deviations, in the same order.
pub fn stated(placed: &Placed) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for row in &placed.rows {
        let deviation = row.deviation();
        let parts = [deviation.position_m, deviation.height_m, deviation.heading_deg];
        sum.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
    }
    sum.map(|sum| sum / placed.rows.len() as f64)
}
