//! The positions of the scanner near a point, for clouds whose times do not determine which of them measured it.

use super::scanner;
use super::sweep::{Sweep, difference};
use std::collections::BTreeMap;

/// Side of a cell of ground, m.
pub(super) const CELL_M: f64 = 1.0;
/// Cells of a block in one direction. A block has one position.
pub(super) const BLOCK_CELLS: i32 = 10;
/// Maximum distance in blocks at which a position may see a point.
const REACH_BLOCKS: i32 = 3;

/// Numbers of a cell or block to the east and north.
pub(super) type Key = (i32, i32);

/// Sweeps by block.
pub(super) struct Nearest {
    by_block: BTreeMap<Key, usize>,
}

/// Sweeps that may see the points of a block.
#[derive(Default)]
pub(super) struct Memory {
    by_block: BTreeMap<Key, Vec<usize>>,
}

/// The cell of a position.
pub(super) fn key_of(position: [f64; 3]) -> Key {
    // Valid coordinates are far below the largest i32.
    ((position[0] / CELL_M).floor() as i32, (position[1] / CELL_M).floor() as i32)
}

/// The block of a cell, or the larger block that contains a smaller one.
pub(super) fn divided((x, y): Key, by: i32) -> Key {
    (x.div_euclid(by), y.div_euclid(by))
}

impl Nearest {
    pub fn new(by_block: BTreeMap<Key, usize>) -> Self {
        Self { by_block }
    }

    /// The nearest position that sees the point with its fine rings, otherwise the nearest.
    pub fn sweep(&self, position: [f64; 3], sweeps: &[Sweep], memory: &mut Memory) -> Option<usize> {
        let block = divided(key_of(position), BLOCK_CELLS);
        let near = memory.by_block.entry(block).or_insert_with(|| self.near(block, sweeps));
        let rank = |&sweep: &usize| {
            let ray = difference(position, sweeps[sweep].begin);
            (!scanner::is_fine(ray), ray[0] * ray[0] + ray[1] * ray[1])
        };
        let best = near.iter().map(|sweep| (rank(sweep), *sweep));
        best.min_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))).map(|(_, sweep)| sweep)
    }

    /// Sweeps of the blocks around a block; without any there, the nearest of all.
    fn near(&self, block: Key, sweeps: &[Sweep]) -> Vec<usize> {
        let reach = -REACH_BLOCKS..=REACH_BLOCKS;
        let around = reach.clone().flat_map(|dx| reach.clone().map(move |dy| (block.0 + dx, block.1 + dy)));
        let found: Vec<usize> = around.filter_map(|key| self.by_block.get(&key).copied()).collect();
        if !found.is_empty() {
            return found;
        }
        let side_m = f64::from(BLOCK_CELLS) * CELL_M;
        let center = [block.0, block.1].map(|key| (f64::from(key) + 0.5) * side_m);
        let distance = |sweep: &Sweep| (sweep.begin[0] - center[0]).hypot(sweep.begin[1] - center[1]);
        let nearest = (0..sweeps.len()).min_by(|&a, &b| distance(&sweeps[a]).total_cmp(&distance(&sweeps[b])));
        nearest.into_iter().collect()
    }
}
