//! The sweeps of a cloud: positions of the scanner, in tiles.

use super::nearest::Nearest;
use super::sweep::Sweep;
use std::ops::Range;

/// Rule by which points are assigned to sweeps.
pub(super) enum Rule {
    /// Assignment by time. Numbers of the time bins, and the shift from their times to stamps, ns.
    Time { bins: Vec<i64>, shift_nanos: i64 },
    /// Assignment by position.
    Nearest(Nearest),
}

/// The sweeps of a file, in tiles.
pub(super) struct Sweeps {
    pub(super) all: Vec<Sweep>,
    /// Sweeps of each tile.
    pub(super) tiles: Vec<Range<usize>>,
    pub(super) rule: Rule,
}

impl Sweeps {
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    pub fn len(&self) -> usize {
        self.all.len()
    }

    pub fn n_tiles(&self) -> usize {
        self.tiles.len()
    }

    /// Number of the tile of a sweep.
    pub fn tile_of(&self, sweep: usize) -> usize {
        self.tiles.partition_point(|tile| tile.end <= sweep)
    }

    /// Origin of the frame of the submaps of a tile: the first position of the scanner.
    pub fn origin_of(&self, tile: usize) -> [f64; 3] {
        self.all[self.tiles[tile].start].begin
    }
}
