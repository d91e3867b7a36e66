//! A vehicle that drives around a square block of houses, with exact odometry, fixes and inertial samples.

use crate::matched;
use geometry::{Geodetic, Isometry3, LocalFrame, Point3, Pose, Vector3};
use georeference::{GeoreferenceSettings, Georeferencer};
use messages::{GnssRow, ImuRow};
use random::{hash, unit};
use registration::{LocalMap, MapPoint, Registered, SweepMotion};

/// Submaps per round.
pub const LAP_SUBMAPS: usize = 32;
const SUBMAP_M: f64 = 20.0;
/// Sweeps per submap at 10 m/s and 10 Hz.
const SWEEPS_PER_SUBMAP: usize = 20;
const SWEEP_NANOS: i64 = 100_000_000;
/// Side of the block, m.
const SIDE_M: f64 = LAP_SUBMAPS as f64 * SUBMAP_M / 4.0;
/// Width of a house and spacing of points, m.
const HOUSE_M: f64 = 8.0;
const SPACING_M: f64 = 0.5;
/// Extent of the surfaces in the map of the odometry, m.
const REACH_M: f64 = 45.0;

/// `world_from_body` at a position of the round, m from a corner.
fn pose(along_m: f64) -> Pose {
    let side = (along_m / SIDE_M).floor();
    let corner = Isometry3::rotation(Vector3::z() * (side * std::f64::consts::FRAC_PI_2));
    let half = SIDE_M / 2.0;
    corner * Isometry3::translation(along_m - side * SIDE_M - half, -half, 1.0)
}

/// The surfaces around the end of a submap.
pub fn local_map(number: usize) -> LocalMap {
    let here = pose(((number + 1) as f64 * SUBMAP_M).rem_euclid(4.0 * SIDE_M)).translation.vector;
    let mut points = Vec::new();
    let mut add = |position: Vector3<f64>, normal: Vector3<f64>| {
        if (position - here).norm() < REACH_M {
            let normal = normal.cast::<f32>().into();
            points.push(MapPoint { position: position.into(), normal, lever: 0.0, turn_lever: 0.0, batch: 0 });
        }
    };
    let n_along = (SIDE_M / SPACING_M) as usize;
    for side in 0..4_u64 {
        let street = |k: usize, left: f64, up: f64| {
            pose(side as f64 * SIDE_M + k as f64 * SPACING_M) * Point3::new(0.0, left, up - 1.0)
        };
        let rotation = pose(side as f64 * SIDE_M).rotation;
        for k in 0..n_along {
            for left in -12..=12 {
                add(street(k, f64::from(left) * SPACING_M, 0.0).coords, Vector3::z());
            }
            for outwards in [-1.0, 1.0] {
                // Fronts and heights differ from house to house.
                let house = (k as f64 * SPACING_M / HOUSE_M) as u64;
                let of = |what: u64| f64::from(unit(hash(hash(side * 2 + u64::from(outwards > 0.0), house), what)));
                let front = 7.0 + 4.0 * of(1);
                let height = 4.0 + 10.0 * of(2);
                let normal = rotation * Vector3::new(0.0, -outwards, 0.0);
                for step in 0..(height / SPACING_M) as usize {
                    add(street(k, outwards * front, step as f64 * SPACING_M).coords, normal);
                }
            }
        }
    }
    LocalMap::from_points(&points)
}

/// State of the vehicle.
#[derive(Default)]
pub struct Vehicle {
    n_sweeps: usize,
}

impl Vehicle {
    /// Drives through one submap; returns whether its place was recognized.
    pub fn drive_submap(
        &mut self,
        georeferencer: &mut Georeferencer,
        settings: &GeoreferenceSettings,
        maps: &[LocalMap],
    ) -> bool {
        let submap = self.n_sweeps / SWEEPS_PER_SUBMAP % LAP_SUBMAPS;
        for k in 0..SWEEPS_PER_SUBMAP {
            let along = |k: usize| (submap as f64 + k as f64 / SWEEPS_PER_SUBMAP as f64) * SUBMAP_M;
            let begin = pose(along(k));
            let end = pose(along(k + 1).rem_euclid(4.0 * SIDE_M));
            let stamp = self.n_sweeps as i64 * SWEEP_NANOS;
            if k == 0 {
                georeferencer.begin_submap(begin, stamp);
            }
            if k % 10 == 0 {
                georeferencer.add_gnss(&[fix(stamp, &begin)], settings);
            }
            let sample = |n: i64| ImuRow {
                stamp: stamp + n * SWEEP_NANOS / 10,
                acceleration: [0.0, 0.0, 9.81],
                ..ImuRow::default()
            };
            georeferencer.add_imu(&(0..10).map(sample).collect::<Vec<_>>(), settings);
            georeferencer.add_sweep(&registered(stamp, &begin, &end), &begin, &end);
            georeferencer.update(settings);
            self.n_sweeps += 1;
        }
        georeferencer.end_submap(settings, &maps[submap])
    }
}

fn fix(stamp: i64, world_from_body: &Pose) -> GnssRow {
    let frame = LocalFrame::new(Geodetic::new(48.846_222, 2.346_414, 104.6).unwrap());
    let place = frame.geodetic_from_world(&Point3::from(world_from_body.translation.vector));
    let latitude_deg = place.latitude_deg;
    let longitude_deg = place.longitude_deg;
    let altitude_m = place.altitude_m;
    GnssRow { stamp, latitude_deg, longitude_deg, altitude_m, quality: 1, hdop: 1.0, ..GnssRow::default() }
}

/// A sweep in which the vehicle moves straight.
fn registered(stamp: i64, begin: &Pose, end: &Pose) -> Registered {
    let translation = end.translation.vector - begin.translation.vector;
    let motion = SweepMotion { mid: *begin, translation, rotation: Vector3::zeros() };
    matched::registered(stamp, SWEEP_NANOS as u32, motion, 1000, false)
}
