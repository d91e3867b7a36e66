//! Points of the own vehicle, such as a hood or a roof rack: they belong to no object.
//!
//! The own vehicle keeps its place in the LiDAR frame while the vehicle moves. Traffic may also do so, but not within
//! the outline of a vehicle around the LiDAR.

use geometry::{Quaternion, UnitQuaternion, Vector3};
use messages::{SubmapPoint, SubmapSweep};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// The own vehicle is at most this far from the LiDAR along the direction of travel and across it, m: half of a wide car; a LiDAR on the
/// roof of a van with a hood.
const ALONG_M: f64 = 4.0;
const ACROSS_M: f64 = 1.2;

/// Size of the places in the LiDAR frame, m: several times the noise of the ranges.
const PLACE_M: f64 = 0.15;

/// Share of the sweeps of a submap in which a place has points, and least travel in this submap, m: along parked cars, or behind a car in a
/// jam, places within the outline stay empty.
const SHARE_OF_SWEEPS: f64 = 0.8;
const TRAVEL_M: f64 = 10.0;
const MIN_SWEEPS: usize = 5;

/// Places of the own vehicle in the frames of its LiDARs.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct OwnVehicle {
    places: BTreeSet<Place>,
}

/// A cube of the LiDAR frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
struct Place {
    lidar: u32,
    cell: [i32; 3],
}

/// A point within the outline of the vehicle.
struct NearPoint {
    place: Place,
    sweep: u16,
    point_idx: u32,
}

impl OwnVehicle {
    /// The points of the own vehicle, in increasing order. `candidates` are the points that may be objects, in increasing order. A submap in
    /// which the vehicle moves adds to the places of the own vehicle; every later submap uses them.
    pub fn points(&mut self, sweeps: &[SubmapSweep], points: &[SubmapPoint], candidates: &[u32]) -> Vec<u32> {
        let lidars = lidars(sweeps);
        let near = near(sweeps, &lidars, points, candidates);
        let mut sweeps_of: BTreeMap<Place, BTreeSet<u16>> = BTreeMap::new();
        for point in &near {
            sweeps_of.entry(point.place).or_default().insert(point.sweep);
        }
        if travel_m(sweeps) >= TRAVEL_M {
            let is_own = |place: &Place, n: usize| {
                let n_sweeps = lidars[&place.lidar].n_sweeps;
                n_sweeps >= MIN_SWEEPS && n as f64 >= SHARE_OF_SWEEPS * n_sweeps as f64
            };
            let own = sweeps_of.iter().filter(|(place, seen)| is_own(place, seen.len()));
            self.places.extend(own.map(|(place, _)| *place));
        }
        near.iter().filter(|point| self.has(point.place)).map(|point| point.point_idx).collect()
    }

    /// Whether the own vehicle is at a place or next to it: noise moves points across the border of a place.
    fn has(&self, Place { lidar, cell: [x, y, z] }: Place) -> bool {
        !self.places.is_empty()
            && (0..27).any(|at| {
                let cell = [x + at % 3 - 1, y + at / 3 % 3 - 1, z + at / 9 - 1];
                self.places.contains(&Place { lidar, cell })
            })
    }
}

/// Length of the path of the first LiDAR, m.
fn travel_m(sweeps: &[SubmapSweep]) -> f64 {
    steps(sweeps, 0).map(|step| step.norm()).sum()
}

/// What the sweeps of a LiDAR have in common.
struct Lidar {
    n_sweeps: usize,
    /// Mean direction of travel in its frame; zero if it stands.
    forward: Vector3<f64>,
}

fn lidars(sweeps: &[SubmapSweep]) -> BTreeMap<u32, Lidar> {
    let mut lidars: BTreeMap<u32, Lidar> = BTreeMap::new();
    for sweep in sweeps {
        let lidar = lidars.entry(sweep.lidar).or_insert_with(|| {
            let way: Vector3<f64> = steps(sweeps, sweep.lidar).sum();
            Lidar { n_sweeps: 0, forward: way.try_normalize(f64::MIN_POSITIVE).unwrap_or_default() }
        });
        lidar.n_sweeps += 1;
    }
    lidars
}

fn near(
    sweeps: &[SubmapSweep],
    lidars: &BTreeMap<u32, Lidar>,
    points: &[SubmapPoint],
    candidates: &[u32],
) -> Vec<NearPoint> {
    let mut near = Vec::new();
    for &point_idx in candidates {
        let point = &points[point_idx as usize];
        let Some(sweep) = sweeps.get(usize::from(point.sweep_idx)) else { continue };
        let share = (f64::from(point.offset_nanos) / f64::from(sweep.duration_nanos.max(1))).min(1.0);
        let begin = position(&sweep.submap_from_lidar_begin);
        let lidar = begin + share * (position(&sweep.submap_from_lidar_end) - begin);
        let away = Vector3::new(point.x, point.y, point.z).cast() - lidar;
        // Most points are far away.
        if away.norm() > 2.0 * ALONG_M {
            continue;
        }
        let lidar_from_submap =
            rotation(&sweep.submap_from_lidar_begin).nlerp(&rotation(&sweep.submap_from_lidar_end), share).inverse();
        let p_in_lidar = lidar_from_submap * away;
        let forward = lidars[&sweep.lidar].forward;
        let across = (lidar_from_submap * Vector3::z()).cross(&forward);
        if p_in_lidar.dot(&forward).abs() <= ALONG_M && p_in_lidar.dot(&across).abs() <= ACROSS_M {
            let cell = [0, 1, 2].map(|axis| (p_in_lidar[axis] / PLACE_M).floor() as i32);
            near.push(NearPoint { place: Place { lidar: sweep.lidar, cell }, sweep: point.sweep_idx, point_idx });
        }
    }
    near
}

/// Displacements of a LiDAR from sweep to sweep, in its own frame, m.
fn steps(sweeps: &[SubmapSweep], lidar: u32) -> impl Iterator<Item = Vector3<f64>> {
    let begins =
        move || sweeps.iter().filter(move |sweep| sweep.lidar == lidar).map(|sweep| &sweep.submap_from_lidar_begin);
    begins().zip(begins().skip(1)).map(|(begin, next)| rotation(begin).inverse() * (position(next) - position(begin)))
}

fn position(numbers: &[f32; 7]) -> Vector3<f64> {
    Vector3::new(numbers[0], numbers[1], numbers[2]).cast()
}

fn rotation(numbers: &[f32; 7]) -> UnitQuaternion<f64> {
    let [x, y, z, w] = [3, 4, 5, 6].map(|at| f64::from(numbers[at]));
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
}
