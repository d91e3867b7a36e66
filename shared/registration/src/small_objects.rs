//! Segments objects that stand on the ground and are not larger than a lorry: all that may move (Deschaud 2018, III-A).

use crate::ground::GroundField;
use rayon::prelude::*;

/// Largest box of a small object, m: along, across, up (Deschaud 2018).
const MAX_SIZE_M: [f32; 3] = [14.0, 14.0, 4.0];
/// Points of one object have neighbors nearer than this, m (Deschaud 2018)...
const LINK_M: f32 = 0.5;
/// ... or nearer than this share of the range: 1.3 times the distance of an HDL-32E's rings.
const LINK_SHARE: f32 = 0.03;
/// Columns over which points are linked, so that single lost returns do not split an object.
const LINK_COLUMNS: usize = 3;
/// Objects with fewer points are ignored.
const MIN_POINTS: u32 = 5;

/// Which cells of a range image belong to which small object.
pub(crate) struct SmallObjects {
    /// Object of each cell, [`SmallObjects::NONE`] for none.
    pub of_cell: Vec<u32>,
    /// Objects.
    pub n: usize,
}

#[derive(Clone, Copy)]
struct Extent {
    low: [f32; 3],
    high: [f32; 3],
    n: u32,
}

impl SmallObjects {
    /// No object.
    pub const NONE: u32 = u32::MAX;

    /// Segments the points of a range image, row by row, `cols` in a row; deskewed, z up, relative to the LiDAR, m; NaN in empty
    /// cells.
    pub fn segment(placed: &[[f32; 3]], cols: usize) -> Self {
        let ground = GroundField::grow(placed);
        let without_ground = |point: &[f32; 3]| if ground.contains(*point) { [f32::NAN; 3] } else { *point };
        let standing: Vec<[f32; 3]> = placed.par_iter().with_min_len(cols).map(without_ground).collect();
        let mut labels = Labels::default();
        let of_cell = labels.connect(&standing, cols);
        labels.into_objects(&standing, of_cell)
    }

    /// Cells of all objects, at most `at_most` of each, evenly spread.
    pub fn members(&self, at_most: u32) -> Vec<u32> {
        let mut counts = vec![0_u32; self.n];
        let objects = |(cell, &object): (usize, &u32)| (object != Self::NONE).then_some((cell as u32, object as usize));
        for (_, object) in self.of_cell.iter().enumerate().filter_map(objects) {
            counts[object] += 1;
        }
        let mut n_visited = vec![0_u32; self.n];
        let is_chosen = |(cell, object): (u32, usize)| {
            let number = n_visited[object];
            n_visited[object] += 1;
            number.is_multiple_of(counts[object].div_ceil(at_most)).then_some(cell)
        };
        self.of_cell.iter().enumerate().filter_map(objects).filter_map(is_chosen).collect()
    }
}

impl Extent {
    fn add(&mut self, point: &[f32; 3]) {
        self.low = std::array::from_fn(|axis| self.low[axis].min(point[axis]));
        self.high = std::array::from_fn(|axis| self.high[axis].max(point[axis]));
        self.n += 1;
    }
    fn is_small(&self) -> bool {
        let fits = |axis: usize| self.high[axis] - self.low[axis] < MAX_SIZE_M[axis];
        self.n >= MIN_POINTS && fits(0) && fits(1) && fits(2)
    }
}

/// Labels of connected cells as disjoint sets (union-find); the root is the smallest label.
#[derive(Default)]
struct Labels {
    parents: Vec<u32>,
}

impl Labels {
    /// A label for each cell. Cells that are adjacent in the image and near each other in space get labels of one set.
    fn connect(&mut self, standing: &[[f32; 3]], cols: usize) -> Vec<u32> {
        let mut of_cell = vec![SmallObjects::NONE; standing.len()];
        for (cell, point) in standing.iter().enumerate() {
            if point[0].is_nan() {
                continue;
            }
            let [x, y, z] = *point;
            let limit = (LINK_M * LINK_M).max(LINK_SHARE * LINK_SHARE * (x * x + y * y + z * z));
            // `false` if the other is NaN.
            let is_linked = |other: usize| {
                let other = &standing[other];
                (x - other[0]).powi(2) + (y - other[1]).powi(2) + (z - other[2]).powi(2) < limit
            };
            let col = cell % cols;
            let mut label = SmallObjects::NONE;
            let mut link = |other: usize| {
                let neighbor = of_cell[other];
                // Most neighbors have the same label; then their distance does not matter.
                if neighbor != SmallObjects::NONE && neighbor != label && is_linked(other) {
                    if label == SmallObjects::NONE {
                        label = neighbor;
                    } else {
                        self.join(label, neighbor);
                    }
                }
            };
            for step in 1..=LINK_COLUMNS.min(col) {
                link(cell - step);
            }
            if let Some(below) = cell.checked_sub(cols) {
                let row_begin = below - col;
                link(if col == 0 { row_begin + cols - 1 } else { below - 1 });
                link(below);
                link(if col + 1 == cols { row_begin } else { below + 1 });
            }
            // At the right end of a row, columns wrap around to the row's begin.
            for right in cols.max(col + 1)..=col + LINK_COLUMNS {
                link(cell + right - cols - col);
            }
            if label == SmallObjects::NONE {
                label = self.parents.len() as u32;
                self.parents.push(label);
            }
            of_cell[cell] = label;
        }
        of_cell
    }

    /// Numbers the sets that are small objects.
    fn into_objects(mut self, standing: &[[f32; 3]], mut of_cell: Vec<u32>) -> SmallObjects {
        let nothing = Extent { low: [f32::MAX; 3], high: [f32::MIN; 3], n: 0 };
        let mut extents = vec![nothing; self.parents.len()];
        for (label, point) in of_cell.iter_mut().zip(standing).filter(|(label, _)| **label != SmallObjects::NONE) {
            *label = self.root(*label);
            extents[*label as usize].add(point);
        }
        let mut n = 0_u32;
        let numbers: Vec<u32> = extents
            .iter()
            .map(|extent| {
                let is_small = extent.is_small();
                n += u32::from(is_small);
                if is_small { n - 1 } else { SmallObjects::NONE }
            })
            .collect();
        for label in of_cell.iter_mut().filter(|label| **label != SmallObjects::NONE) {
            *label = numbers[*label as usize];
        }
        SmallObjects { of_cell, n: n as usize }
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
    /// The root; halves the path to it.
    fn root(&mut self, mut label: u32) -> u32 {
        while self.parents[label as usize] != label {
            let grandparent = self.parents[self.parents[label as usize] as usize];
            self.parents[label as usize] = grandparent;
            label = grandparent;
        }
        label
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn post_across_the_image_seam_is_one_object_and_a_long_wall_is_not() {
        // Rings 2 m apart in height at a range of 10 m, a full turn of 360 columns, floor far below.
        let (cols, rows) = (360, 6);
        let mut placed = vec![[f32::NAN; 3]; rows * cols];
        for row in 0..rows {
            for col in 0..cols {
                let angle = (col as f32).to_radians();
                let at = |range: f32, height: f32| [range * angle.cos(), range * angle.sin(), height];
                placed[row * cols + col] = match (row, col) {
                    (0, _) => at(4.0, -2.0),
                    (_, 357..360 | 0..3) => at(10.0, -1.6 + 0.3 * row as f32),
                    (_, 100..200) => at(20.0, -1.6 + 0.3 * row as f32),
                    _ => [f32::NAN; 3],
                };
            }
        }
        let objects = SmallObjects::segment(&placed, cols);
        assert_eq!(objects.n, 1, "the wall is 35 m long");
        let of_post = |cell: usize| cell >= cols && (cell % cols < 3 || cell % cols >= 357);
        for (cell, object) in objects.of_cell.iter().enumerate() {
            assert_eq!(*object == 0, of_post(cell), "cell {cell}");
        }
        let members = objects.members(10);
        assert!((8..=10).contains(&members.len()) && members.iter().all(|cell| of_post(*cell as usize)), "{members:?}");
    }
}
