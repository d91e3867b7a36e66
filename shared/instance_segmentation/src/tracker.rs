//! Associates objects of a submap with objects of earlier submaps.
//!
//! Neighboring submaps overlap, so an object at their border has a footprint in both. The tracker stores ids and footprints of the
//! objects of the last submaps, in cells of odom. Submaps are not delayed: the later part of an object gets the id of the
//! earlier part.

use crate::footprint::{Footprint, overlap};
use crate::object::{Motion, Object, Waypoint};
use crate::settings::Kind;
use geometry::{BevGrid, Point3, Pose, Vector3};
use serde::{Deserialize, Serialize};

/// Cell size for comparing footprints of two submaps, m: larger than the pose errors.
const CELL_M: f64 = 0.2;

/// An object moves if its first and its last footprint overlap by less than this fraction of the smaller one.
const SAME_PLACE: f64 = 0.2;

/// Longest gap in the observation of a moving object, ns.
const MAX_PAUSE_NANOS: i64 = 1_000_000_000;

/// Error of the predicted center of a moving object: m, lengths of a typical object if that is more, because the LiDAR sees another part of
/// it, and a share of the predicted displacement.
const GATE_M: f64 = 1.0;
const GATE_LENGTHS: f64 = 0.5;
const GATE_SHARE: f64 = 0.5;

/// Error of the predicted center of a piece without a motion of its own, as a share of the predicted displacement: nothing else confirms it.
const GATE_SHARE_OF_PIECE: f64 = 0.15;

/// Largest number of tracked objects. The oldest are removed first.
const MAX_OBJECTS: usize = 4096;

/// Objects of earlier submaps, the latest observed last.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Tracker {
    objects: Vec<TrackedObject>,
}

/// Coordinates in odom over `CELL_M`, rounded down; ordered by x.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
struct OdomCell {
    x: i32,
    y: i32,
}

/// Footprint of an object in odom.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TrackedObject {
    /// Id; 0 before one is assigned.
    pub id: u32,
    class: u8,
    /// Error of the predicted center without displacement, m.
    gate_m: f64,
    footprint: Footprint<OdomCell>,
    begin: i64,
    end: i64,
    /// Motion of a moving object, in odom.
    motion: Option<Motion>,
    /// Mean time and position of its points, in odom.
    middle: Waypoint,
    /// Number of submaps since its last observation.
    age: u32,
}

impl TrackedObject {
    /// The object in odom, without id.
    pub fn from_object(object: &Object, kind: &Kind, grid: &BevGrid, odom_from_submap: &Pose) -> Self {
        let odom_cell = |&(row, col): &(usize, usize)| {
            let (x, y) = grid.center(row, col);
            let p_in_odom = odom_from_submap * Point3::new(x, y, 0.0);
            OdomCell { x: (p_in_odom.x / CELL_M).floor() as i32, y: (p_in_odom.y / CELL_M).floor() as i32 }
        };
        let motion = object.motion.map(|Motion { first, last, velocity: [vx, vy] }| {
            let place = |Waypoint { nanos, center: [x, y] }| {
                let p_in_odom = odom_from_submap * Point3::new(x, y, 0.0);
                Waypoint { nanos, center: [p_in_odom.x, p_in_odom.y] }
            };
            let velocity = odom_from_submap.rotation * Vector3::new(vx, vy, 0.0);
            Motion { first: place(first), last: place(last), velocity: [velocity.x, velocity.y] }
        });
        let footprint = object.footprint.mapped(odom_cell);
        let [x, y] = object.middle.center;
        let p_in_odom = odom_from_submap * Point3::new(x, y, 0.0);
        let middle = Waypoint { nanos: object.middle.nanos, center: [p_in_odom.x, p_in_odom.y] };
        let class = kind.class as u8;
        let gate_m = GATE_M.max(GATE_LENGTHS * kind.length_m);
        Self {
            id: 0,
            class,
            gate_m,
            footprint,
            begin: object.begin_nanos,
            end: object.end_nanos,
            motion,
            middle,
            age: 0,
        }
    }

    fn is_moving(&self) -> bool {
        self.motion.is_some() || self.footprint.overlap_of_ends() < SAME_PLACE
    }

    /// Whether `later` is a piece of this moving object: its points are, in the mean, where the motion predicts them. A submap that starts
    /// or ends soon has too few sweeps for a track.
    fn is_continued_by_piece(&self, later: &Self) -> bool {
        let Some(motion) = self.motion.filter(|_| self.class == later.class && later.motion.is_none()) else {
            return false;
        };
        let nanos = later.middle.nanos.saturating_sub(motion.last.nanos);
        if !(0..=MAX_PAUSE_NANOS).contains(&nanos) {
            return false;
        }
        let seconds = nanos as f64 * 1e-9;
        let off = |axis: usize| motion.last.center[axis] + motion.velocity[axis] * seconds - later.middle.center[axis];
        let speed_mps = motion.velocity[0].hypot(motion.velocity[1]);
        off(0).hypot(off(1)) <= self.gate_m + GATE_SHARE_OF_PIECE * speed_mps * seconds
    }

    /// Agreement of the predicted center of this object with the first center of `later`: 1 exactly, 0 at the gate.
    fn predicts(&self, later: &Self) -> f64 {
        let Some(motion) = self.motion else { return 0.0 };
        let Some(next) = later.motion else { return 0.0 };
        let seconds = (next.first.nanos - motion.last.nanos).max(0) as f64 * 1e-9;
        let velocity = motion.velocity;
        let off = |axis: usize| motion.last.center[axis] + velocity[axis] * seconds - next.first.center[axis];
        let gate_m = self.gate_m + GATE_SHARE * velocity[0].hypot(velocity[1]) * seconds;
        (1.0 - off(0).hypot(off(1)) / gate_m).max(0.0)
    }

    /// Overlap with the footprint of `later`, or agreement with the prediction of a moving object; 0 if it cannot be
    /// the same object.
    fn overlap_with(&self, later: &Self) -> f64 {
        if self.class != later.class {
            return 0.0;
        }
        if !self.is_moving() && !later.is_moving() {
            return overlap(&self.footprint.all, &later.footprint.all);
        }
        let is_continued = later.begin - self.end <= MAX_PAUSE_NANOS;
        if !is_continued {
            return 0.0;
        }
        overlap(&self.footprint.at_last, &later.footprint.at_first).max(self.predicts(later))
    }
}

/// An object of an earlier submap that is observed again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    /// Its id.
    pub id: u32,
    /// Whether it is where its earlier motion predicts it, although its observation here is too short for a motion.
    pub moves_on: bool,
}

/// A new object that may be an old one.
struct Association {
    /// Overlap, or agreement with the prediction.
    share: f64,
    new_idx: usize,
    old_idx: usize,
}

impl Tracker {
    /// The objects that were observed before. An id is assigned to the object with the largest overlap, or the
    /// first of equal ones; also to pieces on the predicted path of a moving object.
    pub fn associate(&self, objects: &[TrackedObject], min_overlap: f64) -> Vec<Option<Known>> {
        let mut pairs: Vec<Association> = Vec::new();
        for (new_idx, new) in objects.iter().enumerate() {
            for (old_idx, old) in self.objects.iter().enumerate() {
                let share = if old.x_ranges_overlap(new) || (old.motion.is_some() && new.motion.is_some()) {
                    old.overlap_with(new)
                } else {
                    0.0
                };
                if share > 0.0 && share >= min_overlap {
                    pairs.push(Association { share, new_idx, old_idx });
                }
            }
        }
        let in_order = |pair: &Association| (pair.new_idx, pair.old_idx);
        pairs.sort_by(|a, b| b.share.total_cmp(&a.share).then(in_order(a).cmp(&in_order(b))));
        let mut known = vec![None; objects.len()];
        let mut is_taken = vec![false; self.objects.len()];
        for Association { new_idx, old_idx, .. } in pairs {
            if known[new_idx].is_none() && !is_taken[old_idx] {
                known[new_idx] = Some(Known { id: self.objects[old_idx].id, moves_on: false });
                is_taken[old_idx] = true;
            }
        }
        for (known, new) in known.iter_mut().zip(objects).filter(|(known, _)| known.is_none()) {
            let continued = self.objects.iter().find(|old| old.is_continued_by_piece(new));
            *known = continued.map(|old| Known { id: old.id, moves_on: true });
        }
        known
    }

    /// Adds the objects of a submap with their ids. Removes objects that were not observed for `remembered_submaps` submaps.
    pub fn update(&mut self, objects: Vec<TrackedObject>, remembered_submaps: u32) {
        self.objects.iter_mut().for_each(|object| object.age += 1);
        self.objects.retain(|old| old.age < remembered_submaps.max(1) && objects.iter().all(|new| new.id != old.id));
        if remembered_submaps > 0 {
            self.objects.extend(objects);
        } else {
            self.objects.clear();
        }
        let n_too_many = self.objects.len().saturating_sub(MAX_OBJECTS);
        drop(self.objects.drain(..n_too_many));
    }
}

impl TrackedObject {
    /// Whether the ranges of x of the two footprints overlap. A fast test: most pairs are far apart, and cells are sorted by x.
    fn x_ranges_overlap(&self, other: &Self) -> bool {
        let range = |object: &Self| Some([object.footprint.all.first()?.x, object.footprint.all.last()?.x]);
        range(self)
            .zip(range(other))
            .is_some_and(|([low_a, high_a], [low_b, high_b])| low_a <= high_b && low_b <= high_a)
    }
}
