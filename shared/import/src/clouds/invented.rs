//! Sweeps of a cloud without positions of the scanner. A mobile scanner leaves the most points on the ground near its own path:
//! positions are invented above the densest ground of each block.

use super::nearest::{BLOCK_CELLS, CELL_M, Key, Nearest, divided, key_of};
use super::points::CloudPoint;
use super::sweep::Sweep;
use super::sweeps::{Rule, Sweeps};
use std::collections::BTreeMap;

/// Blocks of a tile in one direction.
const TILE_BLOCKS: i32 = 2;
/// Points at most this far above the lowest point of a cell are ground, m.
const GROUND_M: f64 = 0.3;
/// Height of a scanner on a vehicle above the ground, m.
const SCANNER_M: f64 = 2.0;
/// A block has a position if its densest cell has this share of the points of a cell near the path.
const DENSE_SHARE: f64 = 0.25;
/// Rank of a cell near the path among the densest cells of all blocks.
const NEAR_PATH: f64 = 0.95;
/// Time between two positions, ns.
const STEP_NANOS: i64 = 100_000_000;
/// Maximum number of tiles that are ordered as a path from neighbor to neighbor; more tiles are ordered by position.
const MAX_CHAINED: usize = 4096;

/// Maximum number of cells of a cloud, 400 MB: 8 square kilometers.
const MAX_CELLS: usize = 1 << 23;

#[derive(Clone, Copy)]
struct Cell {
    lowest_m: f64,
    n_ground: u32,
}

/// Ground points by cell. Memory: 50 bytes per square meter.
#[derive(Default)]
pub(super) struct GroundCells {
    cells: BTreeMap<Key, Cell>,
}

impl GroundCells {
    /// Adds a point. Fails if the points are too far apart.
    pub fn add(&mut self, point: &CloudPoint) -> Result<(), String> {
        if !point.is_valid() {
            return Ok(());
        }
        let z = point.position[2];
        let cell = self.cells.entry(key_of(point.position)).or_insert(Cell { lowest_m: z, n_ground: 0 });
        if z < cell.lowest_m - GROUND_M {
            cell.n_ground = 0;
        }
        cell.lowest_m = cell.lowest_m.min(z);
        if z <= cell.lowest_m + GROUND_M {
            cell.n_ground = cell.n_ground.saturating_add(1);
        }
        if self.cells.len() > MAX_CELLS {
            return Err(format!("its points lie on more than {MAX_CELLS} square meters; are the coordinates in m?"));
        }
        Ok(())
    }

    /// The sweeps, from `next_stamp` on.
    pub fn sweeps(&self, next_stamp: i64) -> Sweeps {
        let mut densest: BTreeMap<Key, (Key, Cell)> = BTreeMap::new();
        for (key, cell) in &self.cells {
            let best = densest.entry(divided(*key, BLOCK_CELLS)).or_insert((*key, *cell));
            if cell.n_ground > best.1.n_ground {
                *best = (*key, *cell);
            }
        }
        let mut counts: Vec<u32> = densest.values().map(|(_, cell)| cell.n_ground).collect();
        counts.sort_unstable();
        let near_path = counts.get((counts.len() as f64 * NEAR_PATH) as usize).or(counts.last()).copied().unwrap_or(0);
        let is_dense = |cell: &Cell| f64::from(cell.n_ground) >= DENSE_SHARE * f64::from(near_path);
        let mut by_tile: BTreeMap<Key, Vec<(Key, [f64; 3])>> = BTreeMap::new();
        for (block, ((x, y), cell)) in densest.into_iter().filter(|(_, (_, cell))| is_dense(cell)) {
            let center = |key: i32| (f64::from(key) + 0.5) * CELL_M;
            let position = [center(x), center(y), cell.lowest_m + SCANNER_M];
            by_tile.entry(divided(block, TILE_BLOCKS)).or_default().push((block, position));
        }
        let mut all = Vec::new();
        let mut tiles = Vec::new();
        let mut by_block = BTreeMap::new();
        for tile in chained(by_tile.keys().copied().collect()) {
            let first = all.len();
            for (block, position) in by_tile.remove(&tile).unwrap_or_default() {
                by_block.insert(block, all.len());
                let stamp = next_stamp.saturating_add(all.len() as i64 * STEP_NANOS);
                all.push(Sweep { stamp, duration_nanos: 0, begin: position, end: position });
            }
            tiles.push(first..all.len());
        }
        Sweeps { all, tiles, rule: Rule::Nearest(Nearest::new(by_block)) }
    }
}

/// Orders tiles from neighbor to neighbor: each is the nearest of the remaining ones. Objects at the border of two tiles
/// keep their number if the tiles follow each other.
fn chained(mut left: Vec<Key>) -> Vec<Key> {
    if left.len() > MAX_CHAINED {
        return left;
    }
    let mut chain = Vec::with_capacity(left.len());
    let mut at = left.first().copied().unwrap_or_default();
    let distance = |a: Key, b: Key| {
        let dx = i64::from(a.0) - i64::from(b.0);
        let dy = i64::from(a.1) - i64::from(b.1);
        dx * dx + dy * dy
    };
    while let Some(next) = (0..left.len()).min_by_key(|&k| (distance(left[k], at), left[k])) {
        at = left.remove(next);
        chain.push(at);
    }
    chain
}
