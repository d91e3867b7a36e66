//! Top-down grids (bird's-eye view).

/// Raster of a top-down view: square cells over a rectangle. Rows follow x (forward), columns follow y (left).
#[derive(Clone, Debug, PartialEq)]
pub struct BevGrid {
    /// x of the lower edge of row 0, m, a multiple of `cell_m`.
    pub x0: f64,
    /// y of the lower edge of column 0, m, a multiple of `cell_m`.
    pub y0: f64,
    /// Side of a cell, m.
    pub cell_m: f64,
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub cols: usize,
}

impl BevGrid {
    /// The grid from `min` to `max` (x, y, m). The origin is a multiple of `cell_m`, so neighboring grids are aligned. `None` if
    /// the bounds are NaN or empty, or need more than `max_cells` cells.
    pub fn covering(min: [f64; 2], max: [f64; 2], cell_m: f64, max_cells: usize) -> Option<Self> {
        let first = |v: f64| (v / cell_m).floor();
        let x0 = first(min[0]);
        let y0 = first(min[1]);
        let rows = first(max[0]) - x0 + 1.0;
        let cols = first(max[1]) - y0 + 1.0;
        let fits = rows >= 1.0 && cols >= 1.0 && rows * cols <= max_cells as f64;
        fits.then_some(Self { x0: x0 * cell_m, y0: y0 * cell_m, cell_m, rows: rows as usize, cols: cols as usize })
    }
    /// Like [`BevGrid::covering`], but doubles the cell size until the grid has at most `max_cells` cells. `None` if the bounds
    /// are NaN or empty, or if even cells of 1024 times `cell_m` are too many.
    pub fn covering_coarsened(min: [f64; 2], max: [f64; 2], cell_m: f64, max_cells: usize) -> Option<Self> {
        (0..=10).find_map(|doublings| Self::covering(min, max, cell_m * f64::from(1 << doublings), max_cells))
    }
    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.rows * self.cols
    }
    /// Row and column of a point, `None` outside. Every point within the bounds given to [`BevGrid::covering`] has a cell.
    #[inline]
    pub fn cell(&self, x: f64, y: f64) -> Option<(usize, usize)> {
        // Cell numbers are subtracted, not metres: x - x0 rounds, and a point on the edge would fall outside the grid.
        let row = whole(x / self.cell_m)? - whole(self.x0 / self.cell_m + 0.5)?;
        let col = whole(y / self.cell_m)? - whole(self.y0 / self.cell_m + 0.5)?;
        let inside = row >= 0 && col >= 0 && row < self.rows as i64 && col < self.cols as i64;
        inside.then_some((row as usize, col as usize))
    }
    /// x and y of the center of a cell, m.
    pub fn center(&self, row: usize, col: usize) -> (f64, f64) {
        (self.x0 + (row as f64 + 0.5) * self.cell_m, self.y0 + (col as f64 + 0.5) * self.cell_m)
    }
}

/// Largest integer up to `value`. [`f64::floor`] would be a function call on processors without SSE 4.1. `None` for NaN and beyond
/// 2^62.
#[inline]
fn whole(value: f64) -> Option<i64> {
    const LIMIT: f64 = (1_u64 << 62) as f64;
    let towards_zero = value as i64;
    (value.abs() < LIMIT).then(|| towards_zero - i64::from(towards_zero as f64 > value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn center_of_a_cell_lies_in_the_cell() {
        let grid = BevGrid::covering([-3.05, 1.0], [2.0, 4.4], 0.1, 10_000).expect("fits");
        for row in 0..grid.rows {
            for col in 0..grid.cols {
                let (x, y) = grid.center(row, col);
                assert_eq!(grid.cell(x, y), Some((row, col)));
            }
        }
        assert_eq!(grid.cell(-3.2, 2.0), None);
        assert_eq!(grid.cell(f64::NAN, 2.0), None);
        assert_eq!(BevGrid::covering([0.0, 0.0], [100.0, 100.0], 0.1, 1000), None);
        assert_eq!(BevGrid::covering([f64::NAN, 0.0], [1.0, 1.0], 0.1, 1000), None);
    }

    #[test]
    fn bounds_are_inside_the_grid_at_any_position() {
        for i in 0..20_000_u32 {
            let low = (f64::from(i) * 12.345_678_9).rem_euclid(2000.0) - 1000.0;
            let high = low + f64::from(i % 97) * 0.1;
            let grid = BevGrid::covering([low, low], [high, high], 0.1, 10_000).expect("fits");
            assert_eq!(grid.cell(low, low), Some((0, 0)), "{low}");
            assert_eq!(grid.cell(high, high), Some((grid.rows - 1, grid.cols - 1)), "{low} to {high}");
        }
    }

    #[test]
    fn cell_size_doubles_until_the_limit_is_met() {
        let grid = BevGrid::covering_coarsened([-50.0, 0.0], [50.0, 100.0], 0.1, 70_000).expect("fits when coarser");
        assert_eq!((grid.cell_m, grid.rows, grid.cols), (0.4, 251, 251));
        assert_eq!(BevGrid::covering_coarsened([0.0, 0.0], [f64::INFINITY, 1.0], 0.1, 70_000), None);
        assert_eq!(BevGrid::covering_coarsened([0.0, 0.0], [1e9, 1e9], 0.1, 70_000), None);
    }
}
