//! Maxima of a histogram in three dimensions.

use crate::space::Points;

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
    /// Pixels that the maximum is above the highest pass to a higher one. Infinite for the highest maximum.
    pub contrast: f64,
}

/// The points of a hemisphere, sorted by cell.
pub(crate) struct Histogram {
    /// Numbers of the points as they were given.
    pub order: Vec<u32>,
    /// The points in this order: neighbors in memory are neighbors in space.
    pub points: Points,
    /// Occupied cells in ascending order: cell, begin in `order`.
    cells: Vec<(usize, usize)>,
}

impl Cells {
    /// `bins` cells along the axis on which the points extend most.
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

    /// Sorts the points with these numbers into cells. `counts` is empty or what an earlier call has left.
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
        occupied.sort_unstable();
        let mut begin = 0;
        let mut cells = Vec::with_capacity(occupied.len());
        for cell in occupied {
            cells.push((cell, begin));
            begin += std::mem::replace(&mut counts[cell], begin as u32) as usize;
        }
        let mut order = vec![0; numbers.len()];
        for (number, cell) in numbers.iter().zip(&of) {
            order[counts[*cell as usize] as usize] = *number;
            counts[*cell as usize] += 1;
        }
        cells.iter().for_each(|(cell, _)| counts[*cell] = 0);
        Histogram { points: all.selected(&order), order, cells }
    }

    /// All local maxima of a histogram with their contrasts (dynamics), highest contrast first. Those above h are the h-maxima.
    ///
    /// Cells are visited from the highest down; a cell joins the components of its visited neighbors. Where two components meet, the
    /// maximum of the lower one ends, and its contrast is the way down to this pass.
    pub fn maxima(&self, histogram: &Histogram) -> Vec<Maximum> {
        let cells = &histogram.cells;
        let end = |index: usize| cells.get(index + 1).map_or(histogram.order.len(), |(_, begin)| *begin);
        let count = |index: usize| (end(index) - cells[index].1) as f64;
        let mut by_height: Vec<usize> = (0..cells.len()).collect();
        by_height.sort_by(|a, b| count(*b).total_cmp(&count(*a)).then(a.cmp(b)));
        // By cell: its component, known by its peak. `None`: not yet visited.
        let mut parent: Vec<Option<usize>> = vec![None; cells.len()];
        let mut rank = vec![0; cells.len()];
        by_height.iter().zip(0..).for_each(|(index, height_rank)| rank[*index] = height_rank);
        let mut contrast = vec![0.0; cells.len()];
        for index in by_height.iter().copied() {
            parent[index] = Some(index);
            for step in self.neighbors() {
                let neighbor = cells[index].0.wrapping_add_signed(step);
                let Ok(other) = cells.binary_search_by_key(&neighbor, |(cell, _)| *cell) else { continue };
                if parent[other].is_none() {
                    continue;
                }
                let (a, b) = (root(&mut parent, index), root(&mut parent, other));
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
        let mean = |index: usize| {
            let range = cells[index].1..end(index);
            let n = range.len() as f64;
            histogram.points.0.each_ref().map(|axis| axis[range.clone()].iter().sum::<f64>() / n)
        };
        // A cell that joined a component at its own height is no maximum.
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
