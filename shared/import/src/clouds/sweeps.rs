//! The sweeps of a cloud: where the scanner was, and which points it saw from there.

use super::invented::{Memory, Nearest};
use super::points::CloudPoint;
use super::{scanner, true_path};
use messages::{SubmapPoint, SubmapSweep};
use std::ops::Range;

/// A stretch of the path of the scanner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sweep {
    /// ns, as in the recording.
    pub stamp: i64,
    pub duration_nanos: u32,
    /// Positions at its begin and end, m.
    pub begin: [f64; 3],
    pub end: [f64; 3],
}

/// How points find their sweep.
pub(super) enum Rule {
    /// By time. Numbers of the bins of time, and the shift from their times to stamps, ns.
    Time { bins: Vec<i64>, shift_nanos: i64 },
    /// By position.
    Nearest(Nearest),
}

/// The sweeps of a file, in tiles.
pub(super) struct Sweeps {
    pub(super) all: Vec<Sweep>,
    /// Sweeps of each tile.
    pub(super) tiles: Vec<Range<usize>>,
    pub(super) rule: Rule,
}

/// Finds the sweeps of points; keeps what was looked up.
#[derive(Default)]
pub(super) struct Finder {
    nearest: Memory,
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

impl Sweep {
    /// In the frame of a submap, without its points. `seq` is its number in the recording.
    pub fn entry(&self, seq: u64, origin: [f64; 3]) -> SubmapSweep {
        let pose = |position: [f64; 3]| {
            let [x, y, z] = difference(position, origin).map(|value| value as f32);
            [x, y, z, 0.0, 0.0, 0.0, 1.0]
        };
        SubmapSweep {
            stamp: self.stamp,
            seq,
            duration_nanos: self.duration_nanos,
            submap_from_lidar_begin: pose(self.begin),
            submap_from_lidar_end: pose(self.end),
            ..SubmapSweep::default()
        }
    }
}

impl Finder {
    /// The sweep of a point and its row in the tile of the sweep; `None` for an invalid point.
    pub fn row(&mut self, point: &CloudPoint, sweeps: &Sweeps) -> Option<(usize, SubmapPoint)> {
        if !point.is_valid() {
            return None;
        }
        let (sweep, offset_nanos) = match &sweeps.rule {
            Rule::Time { bins, shift_nanos } => {
                let sweep = bins.binary_search(&true_path::bin(point.time_s)).ok()?;
                let stamp = true_path::nanos(point.time_s).saturating_add(*shift_nanos);
                (sweep, u32::try_from(stamp.saturating_sub(sweeps.all[sweep].stamp)).ok()?)
            }
            Rule::Nearest(nearest) => (nearest.sweep(point.position, &sweeps.all, &mut self.nearest)?, 0),
        };
        let position = point.scanner.unwrap_or(sweeps.all[sweep].begin);
        let row = scanner::row(difference(point.position, position), point.intensity, point.cosine);
        let tile = sweeps.tile_of(sweep);
        let [x, y, z] = difference(point.position, sweeps.origin_of(tile)).map(|value| value as f32);
        // A tile has at most as many sweeps as a submap.
        let sweep_idx = (sweep - sweeps.tiles[tile].start) as u16;
        Some((sweep, SubmapPoint { x, y, z, offset_nanos, sweep_idx, ..row }))
    }
}

pub(super) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}
