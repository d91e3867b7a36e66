//! Heights of the ground on a coarse lattice, from which contour lines are computed.

use super::Tile;
use super::cells::TILE;
use std::collections::BTreeMap;

/// Least distance of neighboring nodes, m. Chosen on the sample: the noise of cells of 0.2 m bends contour lines of a street.
const MIN_NODE_M: f64 = 0.8;

/// Column and row of a node, from the origin of the coordinates to the east and north.
pub(crate) type Node = [i64; 2];

/// Means of the cells around nodes. 16 kB for each tile of 51 m stay in memory.
pub(crate) struct Nodes {
    /// Cells along a side of the square of a node, a power of two.
    cells: usize,
    /// Distance of neighboring nodes, m.
    pub(crate) side_m: f64,
    /// Heights by tile, rows from south to north; NaN where unknown.
    tiles: BTreeMap<Tile, Vec<f32>>,
}

impl Nodes {
    /// No nodes, for cells of this side, m.
    pub(super) fn new(cell_m: f64) -> Self {
        let mut cells = 1;
        while cells < TILE && cells as f64 * cell_m < MIN_NODE_M {
            cells *= 2;
        }
        Self { cells, side_m: cells as f64 * cell_m, tiles: BTreeMap::new() }
    }

    /// Nodes along the side of a tile.
    fn per_side(&self) -> usize {
        TILE / self.cells
    }

    /// Adds the heights of the cells of a tile, rows from north to south.
    pub(super) fn add(&mut self, tile: Tile, heights: &[f32], no_height: f32) {
        let n = self.per_side();
        let node = |idx: usize| {
            let [column, row] = [idx % n, idx / n].map(|node| node * self.cells);
            let top = TILE - row - self.cells;
            let rows = heights[top * TILE..].chunks(TILE).take(self.cells);
            let known = rows.flat_map(|row| &row[column..column + self.cells]).filter(|height| **height != no_height);
            let (sum, n) = known.fold((0.0_f64, 0), |(sum, n), height| (sum + f64::from(*height), n + 1));
            // At the edge of the ground, few cells are the mean of another place.
            if 2 * n >= self.cells * self.cells { (sum / n as f64) as f32 } else { f32::NAN }
        };
        let nodes: Vec<f32> = (0..n * n).map(node).collect();
        self.tiles.insert(tile, nodes);
    }

    /// Height of a node, m. NaN where it is unknown.
    pub(crate) fn height(&self, [x, y]: Node) -> f32 {
        let n = self.per_side() as i64;
        let tile = (x.div_euclid(n), y.div_euclid(n));
        let idx = y.rem_euclid(n) * n + x.rem_euclid(n);
        self.tiles.get(&tile).map_or(f32::NAN, |heights| heights[idx as usize])
    }

    /// All nodes, tile by tile.
    pub(crate) fn all(&self) -> impl Iterator<Item = Node> {
        let n = self.per_side() as i64;
        let square =
            move |(column, row): Tile| (0..n).flat_map(move |y| (0..n).map(move |x| [column * n + x, row * n + y]));
        self.tiles.keys().copied().flat_map(square)
    }

    /// Easting and northing of a node, m.
    pub(crate) fn place(&self, [x, y]: Node) -> [f64; 2] {
        [x, y].map(|number| (number as f64 + 0.5) * self.side_m)
    }

    /// Replaces heights by means over the neighbors, weighted 1 2 1 along both axes: the weights of unknown neighbors are left out.
    pub(crate) fn smoothed(&self) -> Self {
        let mean = |[x, y]: Node| {
            if self.height([x, y]).is_nan() {
                return f32::NAN;
            }
            let mut sum = 0.0;
            let mut weights = 0.0;
            for (i, j) in (-1..=1_i64).flat_map(|i| (-1..=1_i64).map(move |j| (i, j))) {
                let height = f64::from(self.height([x + i, y + j]));
                if height.is_finite() {
                    let weight = f64::from((2 - i.abs() as i32) * (2 - j.abs() as i32));
                    sum += weight * height;
                    weights += weight;
                }
            }
            (sum / weights) as f32
        };
        let n = self.per_side() as i64;
        let tile = |tile: &Tile| (0..n * n).map(|idx| mean([tile.0 * n + idx % n, tile.1 * n + idx / n])).collect();
        let tiles = self.tiles.keys().map(|key| (*key, tile(key))).collect();
        Self { tiles, ..*self }
    }
}

#[cfg(test)]
impl Nodes {
    /// Nodes of one tile with cells of 1 m: a height for each place.
    pub(crate) fn from_heights(height: impl Fn([f64; 2]) -> f32) -> Self {
        let mut nodes = Self::new(1.0);
        let cells: Vec<f32> = (0..TILE * TILE)
            .map(|idx| height([(idx % TILE) as f64 + 0.5, (TILE - 1 - idx / TILE) as f64 + 0.5]))
            .collect();
        nodes.add((0, 0), &cells, f32::NEG_INFINITY);
        nodes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_is_the_mean_of_its_cells_at_its_place() {
        let mut nodes = Nodes::new(0.2);
        assert_eq!((nodes.cells, nodes.side_m), (4, 0.8));
        // Heights rise by 1 m per cell to the north.
        let cells: Vec<f32> = (0..TILE * TILE).map(|idx| (TILE - 1 - idx / TILE) as f32).collect();
        nodes.add((-1, 2), &cells, -9999.0);
        assert_eq!(nodes.height([-64, 128]), 1.5);
        assert_eq!(nodes.height([-1, 130]), 9.5);
        assert!(nodes.height([0, 128]).is_nan());
        assert_eq!(nodes.all().count(), 64 * 64);
        let [x, y] = nodes.place([-64, 128]);
        assert!((x + 50.8).abs() < 1e-9 && (y - 102.8).abs() < 1e-9, "{x} {y}");
        let smooth = nodes.smoothed();
        assert_eq!(smooth.height([-30, 140]), nodes.height([-30, 140]));
        // Without neighbors to the south: 2 of the row and 1 of the next one.
        assert!((smooth.height([-30, 128]) - (1.5 * 2.0 + 5.5) / 3.0).abs() < 1e-5);
    }
}
