//! Segments objects that stand on the ground and are not larger than a lorry: all objects that can move (Deschaud 2018,
//! III-A).

use crate::moving_objects::ground_field::GroundField;

/// Largest box of a small object, m: along, across, up (Deschaud 2018).
const MAX_SIZE_M: [f32; 3] = [14.0, 14.0, 4.0];
/// Points of one object have neighbors nearer than this, m (Deschaud 2018)...
const LINK_M: f32 = 0.5;
/// ... or nearer than this share of the range: 1.3 times the distance of an HDL-32E's rings.
const LINK_SHARE: f32 = 0.03;
/// Columns over which points are linked, so that single missing returns do not split an object.
const LINK_COLUMNS: usize = 3;
/// Objects with fewer points are ignored.
const MIN_POINTS: u32 = 5;

/// Assignment of the cells of a range image to small objects.
pub(crate) struct SmallObjects {
    /// Cells of all objects, object by object, each in the order of the image.
    cells: Vec<u32>,
    /// End index in `cells` of each object.
    ends: Vec<u32>,
}

#[derive(Clone, Copy)]
struct Extent {
    low: [f32; 3],
    high: [f32; 3],
    n: u32,
}

impl SmallObjects {
    /// Segments the points of a range image, row by row, with `cols` points per row and rows `stride` apart; deskewed,
    /// z up, relative to the LiDAR, m; NaN in empty cells and between the rows.
    pub fn segment(placed: &[[f32; 3]], cols: usize, stride: usize) -> Self {
        let ground = GroundField::grow(placed);
        let mut labels = Labels::default();
        labels.connect(placed, &ground, cols, stride);
        labels.into_objects(placed)
    }

    /// Number of objects.
    pub fn n(&self) -> usize {
        self.ends.len()
    }

    /// Cells of an object, ascending.
    pub fn cells(&self, object: usize) -> &[u32] {
        let begin = if object == 0 { 0 } else { self.ends[object - 1] };
        &self.cells[begin as usize..self.ends[object] as usize]
    }

    /// At most `at_most` cells of an object, evenly spaced.
    pub fn members(&self, object: usize, at_most: usize) -> impl Iterator<Item = u32> {
        let cells = self.cells(object);
        cells.iter().copied().step_by(cells.len().div_ceil(at_most).max(1))
    }

    /// Membership per cell in any object, for the first `n` cells.
    pub fn contained(&self, n: usize) -> Vec<bool> {
        let mut contained = vec![false; n];
        self.cells.iter().for_each(|&cell| contained[cell as usize] = true);
        contained
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

/// Marks a cell without a label.
const NONE: u32 = u32::MAX;

/// Labels of connected cells as disjoint sets (union-find); the root is the smallest label.
#[derive(Default)]
struct Labels {
    parents: Vec<u32>,
    /// Cells that stand on the ground, and their labels.
    standing: Vec<(u32, u32)>,
}

impl Labels {
    /// Assigns a label to each cell above the ground. Cells that are adjacent in the image and near each other in space
    /// get labels of one set.
    fn connect(&mut self, placed: &[[f32; 3]], ground: &GroundField, cols: usize, stride: usize) {
        let mut of_cell = vec![NONE; placed.len()];
        for (row, points) in placed.chunks(stride).enumerate() {
            let row_begin = row * stride;
            for (col, point) in points.iter().enumerate() {
                if point[0].is_nan() || ground.contains(*point) {
                    continue;
                }
                let cell = row_begin + col;
                let [x, y, z] = *point;
                let limit = (LINK_M * LINK_M).max(LINK_SHARE * LINK_SHARE * (x * x + y * y + z * z));
                let is_linked = |other: usize| {
                    let other = &placed[other];
                    (x - other[0]).powi(2) + (y - other[1]).powi(2) + (z - other[2]).powi(2) < limit
                };
                let mut label = NONE;
                let mut link = |other: usize| {
                    let neighbor = of_cell[other];
                    // Most neighbors have the same label; then their distance does not matter.
                    if neighbor != NONE && neighbor != label && is_linked(other) {
                        if label == NONE {
                            label = neighbor;
                        } else {
                            self.join(label, neighbor);
                        }
                    }
                };
                for step in 1..=LINK_COLUMNS.min(col) {
                    link(cell - step);
                }
                if let Some(below) = row_begin.checked_sub(stride) {
                    link(below + if col == 0 { cols - 1 } else { col - 1 });
                    link(below + col);
                    link(below + if col + 1 == cols { 0 } else { col + 1 });
                }
                // At the right end of a row, columns wrap around to its start.
                for right in cols.max(col + 1)..=col + LINK_COLUMNS {
                    link(row_begin + right - cols);
                }
                if label == NONE {
                    label = self.parents.len() as u32;
                    self.parents.push(label);
                }
                of_cell[cell] = label;
                self.standing.push((cell as u32, label));
            }
        }
    }

    /// Numbers the sets that are small objects.
    fn into_objects(mut self, placed: &[[f32; 3]]) -> SmallObjects {
        let roots: Vec<u32> = (0..self.parents.len() as u32).map(|label| self.root(label)).collect();
        let nothing = Extent { low: [f32::MAX; 3], high: [f32::MIN; 3], n: 0 };
        let mut extents = vec![nothing; roots.len()];
        for (cell, label) in &mut self.standing {
            *label = roots[*label as usize];
            extents[*label as usize].add(&placed[*cell as usize]);
        }
        // First the start, later the end of the cells of each object.
        let mut places = vec![NONE; extents.len()];
        let mut n_cells = 0;
        for (place, extent) in places.iter_mut().zip(&extents).filter(|(_, extent)| extent.is_small()) {
            *place = n_cells;
            n_cells += extent.n;
        }
        let mut cells = vec![0; n_cells as usize];
        for (cell, label) in self.standing {
            let place = &mut places[label as usize];
            if *place != NONE {
                cells[*place as usize] = cell;
                *place += 1;
            }
        }
        SmallObjects { cells, ends: places.into_iter().filter(|place| *place != NONE).collect() }
    }

    fn join(&mut self, a: u32, b: u32) {
        let a = self.root(a);
        let b = self.root(b);
        self.parents[a.max(b) as usize] = a.min(b);
    }
    /// The root of a label; halves the path to it.
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
        let cols = 360;
        let rows = 6;
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
        let objects = SmallObjects::segment(&placed, cols, cols);
        assert_eq!(objects.n(), 1, "the wall is 35 m long");
        let of_post = |cell: usize| cell >= cols && (cell % cols < 3 || cell % cols >= 357);
        let expected: Vec<u32> = (0..placed.len() as u32).filter(|&cell| of_post(cell as usize)).collect();
        assert_eq!(objects.cells(0), expected);
        let members: Vec<u32> = objects.members(0, 10).collect();
        assert!((8..=10).contains(&members.len()) && members.iter().all(|cell| of_post(*cell as usize)), "{members:?}");
    }

    #[test]
    fn gap_between_rows_changes_no_object() {
        let cols = 360;
        let rows = 6;
        let stride = 364;
        let mut random = random::Random::new(5);
        let mut narrow = vec![[f32::NAN; 3]; rows * cols];
        let mut wide = vec![[f32::NAN; 3]; rows * stride];
        for row in 0..rows {
            for col in (0..cols).filter(|col| col % 50 < 40) {
                let angle = (col as f32).to_radians();
                let range = 8.0 + random.range(0.0, 0.05);
                let point = [range * angle.cos(), range * angle.sin(), 0.3 * row as f32];
                (narrow[row * cols + col], wide[row * stride + col]) = (point, point);
            }
        }
        let [a, b] = [SmallObjects::segment(&narrow, cols, cols), SmallObjects::segment(&wide, cols, stride)];
        assert!(a.n() > 3, "{}", a.n());
        assert_eq!(a.ends, b.ends);
        let in_wide: Vec<u32> = a.cells.iter().map(|cell| cell / 360 * 364 + cell % 360).collect();
        assert_eq!(in_wide, b.cells);
    }
}
