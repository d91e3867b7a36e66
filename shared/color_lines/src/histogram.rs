//! Maxima of a histogram in three dimensions.

use crate::space::Points;
use std::ops::Range;

/// The cells of histograms: cubes of equal size.
pub(crate) struct Cells {
    low: [f64; 3],
    per_unit: f64,
    /// Cells per axis, with a rim of empty cells.
    side: usize,
}

/// A local maximum of a histogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Maximum {
    /// Mean of the points of its cell.
    pub mean: [f64; 3],
    /// Height in pixels of the maximum above the highest pass to a higher maximum. Infinite for the highest maximum.
    pub contrast: f64,
}

/// The points of a hemisphere, sorted by cell along a Morton curve.
pub(crate) struct Histogram {
    /// Numbers of the points in their original order.
    pub order: Vec<u32>,
    /// The points in this order: neighbors in memory are neighbors in space.
    pub points: Points,
    /// Occupied cells in ascending order.
    cells: Vec<Occupied>,
}

/// A cell with points.
struct Occupied {
    cell: usize,
    /// Its points in `order`.
    points: Range<usize>,
}

impl Cells {
    /// Divides the axis with the largest extent of the points into `bins` cells.
    pub fn new(points: &Points, bins: usize) -> Self {
        let range = |axis: &Vec<f64>| {
            axis.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)])
        };
        let ranges = points.0.each_ref().map(range);
        let extent = ranges.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
        // The upper end of the range belongs to the last cell.
        let per_unit = if extent > 0.0 { bins as f64 / (extent * (1.0 + 1e-9)) } else { 1.0 };
        Self { low: ranges.map(|[low, _]| low), per_unit, side: bins + 2 }
    }

    fn cell(&self, point: [f64; 3]) -> usize {
        let [x, y, z] = [0, 1, 2].map(|k| ((point[k] - self.low[k]) * self.per_unit) as usize + 1);
        (z * self.side + y) * self.side + x
    }

    /// Distances to the 26 neighbors of a cell.
    fn neighbors(&self) -> impl Iterator<Item = isize> {
        let side = self.side as isize;
        (0..27).filter(|k| *k != 13).map(move |k| (k / 9 - 1) * side * side + (k / 3 % 3 - 1) * side + k % 3 - 1)
    }

    /// Sorts the points with these numbers into cells. `counts` is empty or the buffer of an earlier call.
    pub fn histogram(&self, all: &Points, numbers: &[u32], counts: &mut Vec<u32>) -> Histogram {
        counts.resize(self.side.pow(3), 0);
        let of: Vec<u32> = numbers.iter().map(|number| self.cell(all.at(*number as usize)) as u32).collect();
        let mut occupied = Vec::new();
        for cell in &of {
            if counts[*cell as usize] == 0 {
                occupied.push(*cell as usize);
            }
            counts[*cell as usize] += 1;
        }
        // Along a Morton curve, so that consecutive points are close in all directions.
        occupied.sort_unstable_by_key(|cell| self.morton(*cell));
        let mut begin = 0;
        let mut cells = Vec::with_capacity(occupied.len());
        for cell in occupied {
            let n = std::mem::replace(&mut counts[cell], begin as u32) as usize;
            cells.push(Occupied { cell, points: begin..begin + n });
            begin += n;
        }
        cells.sort_unstable_by_key(|occupied| occupied.cell);
        let mut order = vec![0; numbers.len()];
        for (number, cell) in numbers.iter().zip(&of) {
            order[counts[*cell as usize] as usize] = *number;
            counts[*cell as usize] += 1;
        }
        for occupied in &cells {
            counts[occupied.cell] = 0;
        }
        Histogram { points: all.selected(&order), order, cells }
    }

    /// The interleaved bits of the three coordinates of a cell.
    fn morton(&self, cell: usize) -> u32 {
        let coordinates = [cell % self.side, cell / self.side % self.side, cell / self.side / self.side];
        let bit = |k: usize, bit: usize| ((coordinates[k] >> bit & 1) as u32) << (3 * bit + k);
        (0..8).flat_map(|index| [0, 1, 2].map(|k| bit(k, index))).sum()
    }

    /// All local maxima of a histogram with their contrasts (dynamics), highest contrast first. Maxima with a contrast
    /// above h are the h-maxima.
    ///
    /// Cells are visited in descending order of height; a cell joins the components of its visited neighbors. When two
    /// components meet, the maximum of the lower one ends, and its contrast is the height difference to this pass.
    ///
    /// `numbers` is the buffer of [`Cells::histogram`].
    pub fn maxima(&self, histogram: &Histogram, numbers: &mut [u32]) -> Vec<Maximum> {
        let cells = &histogram.cells;
        for (number, occupied) in (1..).zip(cells) {
            numbers[occupied.cell] = number;
        }
        let count = |index: usize| cells[index].points.len() as f64;
        let mut by_height: Vec<usize> = (0..cells.len()).collect();
        by_height.sort_by(|a, b| count(*b).total_cmp(&count(*a)).then(a.cmp(b)));
        // Component of each cell, identified by its peak. `None`: not yet visited.
        let mut parent: Vec<Option<usize>> = vec![None; cells.len()];
        let mut rank = vec![0; cells.len()];
        by_height.iter().zip(0..).for_each(|(index, height_rank)| rank[*index] = height_rank);
        let mut contrast = vec![0.0; cells.len()];
        for index in by_height.iter().copied() {
            parent[index] = Some(index);
            for step in self.neighbors() {
                let neighbor = cells[index].cell.wrapping_add_signed(step);
                let Some(other) = (numbers[neighbor] as usize).checked_sub(1) else { continue };
                if parent[other].is_none() {
                    continue;
                }
                let a = root(&mut parent, index);
                let b = root(&mut parent, other);
                if a != b {
                    let (high, low) = if rank[a] < rank[b] { (a, b) } else { (b, a) };
                    contrast[low] = count(low) - count(index);
                    parent[low] = Some(high);
                }
            }
        }
        for index in 0..cells.len() {
            if parent[index] == Some(index) {
                contrast[index] = if rank[index] == 0 { f64::INFINITY } else { count(index) };
            }
        }
        for occupied in cells {
            numbers[occupied.cell] = 0;
        }
        let mean = |index: usize| {
            let of_cell = |axis: &Vec<f64>| axis[cells[index].points.clone()].iter().sum::<f64>() / count(index);
            histogram.points.0.each_ref().map(of_cell)
        };
        // A cell that joined a component at its own height is not a maximum.
        let is_maximum = |index: &usize| contrast[*index] > 0.0;
        let mut maxima: Vec<Maximum> = (by_height.into_iter().filter(is_maximum))
            .map(|index| Maximum { mean: mean(index), contrast: contrast[index] })
            .collect();
        maxima.sort_by(|a, b| b.contrast.total_cmp(&a.contrast));
        maxima
    }
}

/// The peak of a component, with path halving.
fn root(parent: &mut [Option<usize>], mut index: usize) -> usize {
    while let Some(above) = parent[index].filter(|above| *above != index) {
        parent[index] = parent[above];
        index = above;
    }
    index
}
