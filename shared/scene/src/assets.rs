//! Objects that a simulator replaces by models: vehicles and people with their boxes and tracks, poles, signs and lights with their places.

use messages::ClassId;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use surveying::CloudPoint;
use surveying::objects::ObjectSummary;

/// Classes of fixed objects.
const FIXED: [ClassId; 3] = [ClassId::Pole, ClassId::TrafficSign, ClassId::TrafficLight];
/// Side of the cells that connect the points of a fixed object, m.
const CELL_M: f64 = 0.25;
/// A fixed object has at least this many points: fewer are wrong classes. Chosen on the sample.
const MIN_POINTS: u64 = 40;
/// Largest extent of a fixed object, m: a gantry. Larger ones are wrong classes.
const MAX_EXTENT_M: f64 = 15.0;

/// An object that can move.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Movable {
    /// Number of the instance in the clouds.
    pub instance: i64,
    /// Class.
    pub class: &'static str,
    /// Center of its box, m; z in the middle of its height.
    pub center: [f64; 3],
    /// Length, width and height, m.
    pub size: [f64; 3],
    /// Direction of its length, counter-clockwise from east, rad. Front and rear are not distinguished.
    pub heading: f64,
    /// Mean score of its class, if known.
    pub score: Option<f64>,
    /// Whether it moved. The box then covers its path.
    pub moves: bool,
    /// If it moved: its center in each sweep.
    pub track: Vec<TrackPoint>,
}

/// Place of a moving object in a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrackPoint {
    /// Seconds since the Unix epoch.
    pub time_s: f64,
    /// Mean of its points, m.
    pub center: [f64; 3],
    /// Number of its points.
    pub n_points: u32,
}

/// A fixed object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fixed {
    /// Class.
    pub class: &'static str,
    /// Middle of its points, m; z of the lowest one.
    pub place: [f64; 3],
    /// Height of its points, m.
    pub height_m: f64,
    /// Larger horizontal extent, m.
    pub extent_m: f64,
    /// Number of points.
    pub n_points: u64,
}

/// Collects objects from the points of a run.
#[derive(Default)]
pub struct Assets {
    /// Sums of moving objects by instance and sweep.
    moving: BTreeMap<i64, BTreeMap<u32, Sums>>,
    /// Numbers of points by instance: all, and those on moving objects.
    marked: BTreeMap<i64, [u64; 2]>,
    /// Points of fixed objects by class and cell.
    fixed: BTreeMap<ClassId, BTreeMap<[i64; 2], Cell>>,
}

#[derive(Clone, Copy, Default)]
struct Sums {
    time_s: f64,
    xyz: [f64; 3],
    n: u32,
}

#[derive(Clone, Copy)]
struct Cell {
    n: u64,
    low_m: f64,
    high_m: f64,
}

impl Assets {
    /// Adds a point of the run.
    pub fn add(&mut self, point: &CloudPoint) {
        if point.instance != 0 {
            let [n, n_moving] = self.marked.entry(point.instance.into()).or_default();
            *n += 1;
            *n_moving += u64::from(point.is_moving);
            if !point.is_moving {
                return;
            }
            let sums = self.moving.entry(point.instance.into()).or_default().entry(point.frame).or_default();
            sums.n += 1;
            sums.time_s += point.time_s;
            sums.xyz.iter_mut().zip(point.xyz).for_each(|(sum, value)| *sum += value);
        } else if let Some(class) = ClassId::from_id(point.class).filter(|class| FIXED.contains(class)) {
            let [x, y, z] = point.xyz;
            let cell = [x, y].map(|value| (value / CELL_M).floor() as i64);
            let cell = self.fixed.entry(class).or_default().entry(cell).or_insert(Cell { n: 0, low_m: z, high_m: z });
            cell.n += 1;
            cell.low_m = cell.low_m.min(z);
            cell.high_m = cell.high_m.max(z);
        }
    }

    /// The objects that can move, by instance. `objects` are their boxes.
    pub fn movable(&self, objects: &[ObjectSummary]) -> Vec<Movable> {
        objects.iter().map(|object| self.movable_of(object)).collect()
    }

    fn movable_of(&self, object: &ObjectSummary) -> Movable {
        let [n, n_moving] = self.marked.get(&object.id).copied().unwrap_or_default();
        let moves = 2 * n_moving > n;
        let sweeps = self.moving.get(&object.id).filter(|_| moves);
        let point = |sums: &Sums| TrackPoint {
            time_s: sums.time_s / f64::from(sums.n),
            center: sums.xyz.map(|sum| sum / f64::from(sums.n)),
            n_points: sums.n,
        };
        let footprint = &object.footprint;
        Movable {
            instance: object.id,
            class: object.class,
            center: [footprint.center[0], footprint.center[1], 0.5 * (object.low_m + object.high_m)],
            size: [footprint.length_m, footprint.width_m, object.high_m - object.low_m],
            heading: footprint.heading,
            score: object.score,
            moves,
            track: sweeps.into_iter().flat_map(BTreeMap::values).map(point).collect(),
        }
    }

    /// The fixed objects, by class, then from west to east.
    pub fn fixed(&self) -> Vec<Fixed> {
        let mut found = Vec::new();
        for (class, cells) in &self.fixed {
            let mut left: BTreeSet<[i64; 2]> = cells.keys().copied().collect();
            while let Some(first) = left.pop_first() {
                let mut group = vec![first];
                let mut next = 0;
                while next < group.len() {
                    let [x, y] = group[next];
                    next += 1;
                    let near = (-1..=1).flat_map(|i| (-1..=1).map(move |j| [x + i, y + j]));
                    group.extend(near.filter(|cell| left.remove(cell)));
                }
                found.extend(object(*class, &group, cells));
            }
        }
        found
    }
}

/// The object of connected cells. `None` if it is too small or too large.
fn object(class: ClassId, group: &[[i64; 2]], cells: &BTreeMap<[i64; 2], Cell>) -> Option<Fixed> {
    let members = || group.iter().map(|cell| (cell, &cells[cell]));
    let n_points: u64 = members().map(|(_, cell)| cell.n).sum();
    let middle = |axis: usize| {
        let sum: f64 = members().map(|(place, cell)| (place[axis] as f64 + 0.5) * CELL_M * cell.n as f64).sum();
        sum / n_points as f64
    };
    let extent_m = |axis: usize| {
        let places = || group.iter().map(|cell| cell[axis]);
        (places().max().unwrap_or(0) - places().min().unwrap_or(0) + 1) as f64 * CELL_M
    };
    let low_m = members().map(|(_, cell)| cell.low_m).fold(f64::INFINITY, f64::min);
    let high_m = members().map(|(_, cell)| cell.high_m).fold(f64::NEG_INFINITY, f64::max);
    let extent_m = extent_m(0).max(extent_m(1));
    let is_object = n_points >= MIN_POINTS && extent_m <= MAX_EXTENT_M;
    is_object.then(|| Fixed {
        class: class.name(),
        place: [middle(0), middle(1), low_m],
        height_m: high_m - low_m,
        extent_m,
        n_points,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::removal::tests::point;
    use geometry::OrientedRectangle;

    #[test]
    fn poles_are_separated_and_specks_are_left_out() {
        let mut assets = Assets::default();
        for (x, n) in [(10.0, 100), (12.0, 60), (30.0, 5)] {
            (0..n).for_each(|k| assets.add(&point(ClassId::Pole, [x, -4.0, 0.05 * f64::from(k)])));
        }
        let found = assets.fixed();
        assert_eq!(found.iter().map(|object| object.n_points).collect::<Vec<_>>(), [100, 60]);
        assert!((found[0].place[0] - 10.125).abs() < 1e-9 && (found[0].height_m - 4.95).abs() < 1e-9);
    }

    #[test]
    fn moving_object_has_a_track_and_a_standing_one_has_none() {
        let mut assets = Assets::default();
        for (instance, is_moving) in [(1, true), (2, false)] {
            for frame in 0..3 {
                let at = point(ClassId::Vehicles, [f64::from(frame) * 2.0, 0.0, 1.0]);
                assets.add(&CloudPoint { instance, is_moving, frame, time_s: f64::from(frame), ..at });
            }
        }
        let footprint = OrientedRectangle { center: [2.0, 0.0], length_m: 4.0, width_m: 1.0, heading: 0.0 };
        let object = |id| ObjectSummary {
            id,
            class: "vehicles",
            n_points: 3,
            n_clouds: 1,
            score: None,
            footprint,
            low_m: 0.0,
            high_m: 2.0,
        };
        let [driving, parked] = &assets.movable(&[object(1), object(2)])[..] else { panic!("two objects") };
        assert!(driving.moves && !parked.moves && parked.track.is_empty());
        assert_eq!(driving.track.iter().map(|at| at.center[0]).collect::<Vec<_>>(), [0.0, 2.0, 4.0]);
        assert_eq!((parked.center, parked.size), ([2.0, 0.0, 1.0], [4.0, 1.0, 2.0]));
    }
}
