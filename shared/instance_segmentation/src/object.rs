//! Objects of a submap: their points, footprints and motion.

use crate::footprint::Footprint;
use crate::sets::{SetNumbers, Sets};
use crate::top_view::Cell;
use serde::{Deserialize, Serialize};

/// An object of the submap.
pub struct Object {
    /// Indices of its points, increasing.
    pub points: Vec<u32>,
    /// Its cells, sorted.
    pub footprint: Footprint<Cell>,
    /// Time of its first point, ns since the Unix epoch.
    pub begin_nanos: i64,
    /// Time of its last point, ns since the Unix epoch.
    pub end_nanos: i64,
    /// Mean time and position of its points.
    pub middle: Waypoint,
    /// Whether there is ground around it; `true` if unknown.
    pub is_grounded: bool,
    /// Its motion, if most of its points are on the track of a moving object.
    pub motion: Option<Motion>,
}

/// Motion of an object over a submap.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Its first blob.
    pub first: Waypoint,
    /// Its last blob.
    pub last: Waypoint,
    /// Mean velocity, m/s.
    pub velocity: [f64; 2],
}

/// Position of an object at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Waypoint {
    /// Time, ns since the Unix epoch.
    pub nanos: i64,
    /// Center, x and y in m.
    pub center: [f64; 2],
}

impl Object {
    pub(crate) fn empty() -> Self {
        Self {
            points: Vec::new(),
            footprint: Footprint::default(),
            begin_nanos: i64::MAX,
            end_nanos: i64::MIN,
            middle: Waypoint { nanos: 0, center: [0.0; 2] },
            is_grounded: false,
            motion: None,
        }
    }

    pub(crate) fn sort(&mut self) {
        self.points.sort_unstable();
        self.footprint.sort();
    }

    /// Appends another object. Call [`Object::sort`] afterwards.
    pub(crate) fn append(&mut self, mut other: Self) {
        self.points.append(&mut other.points);
        self.footprint.append(other.footprint);
        self.begin_nanos = self.begin_nanos.min(other.begin_nanos);
        self.end_nanos = self.end_nanos.max(other.end_nanos);
        self.is_grounded |= other.is_grounded;
        self.motion = self.motion.or(other.motion);
    }
}

/// One object for each set, in the order of first members.
pub(crate) fn united(objects: Vec<Object>, sets: &mut Sets) -> Vec<Object> {
    let SetNumbers { by_member: numbers, n } = sets.numbers();
    let mut joined: Vec<Option<Object>> = (0..n).map(|_| None).collect();
    for (object, &number) in objects.into_iter().zip(&numbers) {
        match &mut joined[number as usize] {
            Some(whole) => whole.append(object),
            empty => *empty = Some(object),
        }
    }
    let mut joined: Vec<Object> = joined.into_iter().flatten().collect();
    joined.iter_mut().for_each(Object::sort);
    joined
}
