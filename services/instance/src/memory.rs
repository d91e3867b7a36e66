//! Which things of a submap were in one before.
//!
//! Neighboring submaps see the same stretch of street from two sides, so a thing that is cut by their border has a footprint in
//! both. Remembered are ids and footprints of the things of the last submaps, in cells of the world; nothing is held back, so the
//! later part gets the id of the earlier one.

use crate::objects::Object;
use crate::visits::overlap;
use geometry::{BevGrid, Point3, Pose};
use serde::{Deserialize, Serialize};

/// Side of a cell in which footprints of two submaps are compared, m: more than poses differ by.
const CELL_M: f64 = 0.2;

/// Footprints that share less than this part of the smaller one are in different places: the thing moves.
const SAME_PLACE: f64 = 0.2;

/// A moving thing is the same if it goes on within this time, ns.
const MAX_PAUSE_NANOS: i64 = 1_000_000_000;

/// Things remembered at most; of a denser street the oldest are forgotten first.
const MAX_THINGS: usize = 4096;

/// Things of earlier submaps, the last seen last.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Memory {
    things: Vec<Remembered>,
}

/// Cell of the world.
type WorldCell = (i32, i32);

/// A thing in the world frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Remembered {
    pub(crate) id: u32,
    class: u8,
    /// All cells, those of its first and those of its last half second, sorted.
    cells: [Vec<WorldCell>; 3],
    begin: i64,
    end: i64,
    /// Submaps since it was seen.
    age: u32,
}

impl Remembered {
    /// As the thing is in the world; `id` is to be given.
    pub(crate) fn of(object: &Object, class: u8, grid: &BevGrid, world_from_submap: &Pose) -> Self {
        let world_cell = |&(row, col): &(usize, usize)| {
            let (x, y) = grid.center(row, col);
            let p_in_world = world_from_submap * Point3::new(x, y, 0.0);
            ((p_in_world.x / CELL_M).floor() as i32, (p_in_world.y / CELL_M).floor() as i32)
        };
        let cells = object.cells.each_ref().map(|cells| {
            let mut cells: Vec<WorldCell> = cells.iter().map(world_cell).collect();
            cells.sort_unstable();
            cells.dedup();
            cells
        });
        Self { id: 0, class, cells, begin: object.span.0, end: object.span.1, age: 0 }
    }

    fn is_moving(&self) -> bool {
        overlap(&self.cells[1], &self.cells[2]) < SAME_PLACE
    }

    /// Share by which `later` lies where this was; 0 if it cannot be the same.
    fn agreement(&self, later: &Self) -> f64 {
        if self.class != later.class {
            return 0.0;
        }
        if !self.is_moving() && !later.is_moving() {
            return overlap(&self.cells[0], &later.cells[0]);
        }
        let goes_on = later.begin - self.end <= MAX_PAUSE_NANOS;
        if goes_on { overlap(&self.cells[2], &later.cells[1]) } else { 0.0 }
    }
}

impl Memory {
    /// Ids of the things that were seen before; each is given once, to the thing that agrees best, the earlier of equals.
    pub(crate) fn recognize(&self, things: &[Remembered], min_overlap: f64) -> Vec<Option<u32>> {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (new_idx, new) in things.iter().enumerate() {
            for (old_idx, old) in self.things.iter().enumerate() {
                let share = if old.touches(new) { old.agreement(new) } else { 0.0 };
                if share > 0.0 && share >= min_overlap {
                    pairs.push((share, new_idx, old_idx));
                }
            }
        }
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut ids = vec![None; things.len()];
        let mut is_taken = vec![false; self.things.len()];
        for (_, new_idx, old_idx) in pairs {
            if ids[new_idx].is_none() && !is_taken[old_idx] {
                ids[new_idx] = Some(self.things[old_idx].id);
                is_taken[old_idx] = true;
            }
        }
        ids
    }

    /// Takes the things of a submap, with their ids; what was not among them for `remembered_submaps` is forgotten.
    pub(crate) fn update(&mut self, things: Vec<Remembered>, remembered_submaps: u32) {
        self.things.iter_mut().for_each(|thing| thing.age += 1);
        self.things.retain(|old| old.age < remembered_submaps.max(1) && things.iter().all(|new| new.id != old.id));
        if remembered_submaps > 0 {
            self.things.extend(things);
        } else {
            self.things.clear();
        }
        let n_too_many = self.things.len().saturating_sub(MAX_THINGS);
        drop(self.things.drain(..n_too_many));
    }
}

impl Remembered {
    /// Whether the rows of the two footprints overlap: most pairs are far apart, and cells are sorted by row.
    fn touches(&self, other: &Self) -> bool {
        let ends = |thing: &Self| thing.cells[0].first().zip(thing.cells[0].last()).map(|(a, b)| (a.0, b.0));
        ends(self).zip(ends(other)).is_some_and(|(a, b)| a.0 <= b.1 && b.0 <= a.1)
    }
}
