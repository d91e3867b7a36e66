//! Top-down images of a feature of a cloud.

use crate::bev::BevGrid;

/// Statistic of the values in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BevStatistic {
    /// The largest value.
    Max,
    /// The smallest value.
    Min,
    /// The largest value less the smallest.
    Difference,
    /// The number of points.
    Accumulation,
    /// The mean of the values.
    Mean,
}

/// Collects a feature of points in the cells of a grid. One pass over the points gives all images.
///
/// ```
/// use geometry::{BevGrid, BevStatistic, BevValues};
///
/// let grid = BevGrid::covering([0.0, 0.0], [1.0, 0.4], 0.5, 100).expect("has 3 cells");
/// let mut heights = BevValues::new(grid);
/// heights.add(0.1, 0.2, 3.0);
/// heights.add(0.2, 0.3, 5.0);
/// assert_eq!(heights.image(BevStatistic::Difference), [Some(2.0), None, None]);
/// ```
#[derive(Clone, Debug)]
pub struct BevValues {
    grid: BevGrid,
    cells: Vec<Cell>,
}

/// The values of a cell.
#[derive(Clone, Copy, Debug)]
struct Cell {
    min: f64,
    max: f64,
    sum: f64,
    n: u64,
}

impl BevValues {
    /// Cells without points.
    pub fn new(grid: BevGrid) -> Self {
        let empty = Cell { min: f64::INFINITY, max: f64::NEG_INFINITY, sum: 0.0, n: 0 };
        Self { cells: vec![empty; grid.n_cells()], grid }
    }
    /// Adds a point. Returns `false` and ignores it if it is outside the grid or its value is not finite.
    pub fn add(&mut self, x: f64, y: f64, value: f64) -> bool {
        let Some((row, col)) = self.grid.cell(x, y).filter(|_| value.is_finite()) else { return false };
        let cell = &mut self.cells[row * self.grid.cols + col];
        cell.min = cell.min.min(value);
        cell.max = cell.max.max(value);
        cell.sum += value;
        cell.n += 1;
        true
    }
    /// The grid.
    pub fn grid(&self) -> &BevGrid {
        &self.grid
    }
    /// An image, row by row; `None` marks cells without points, also of [`BevStatistic::Accumulation`].
    pub fn image(&self, statistic: BevStatistic) -> Vec<Option<f64>> {
        let value = |cell: &Cell| match statistic {
            BevStatistic::Max => cell.max,
            BevStatistic::Min => cell.min,
            BevStatistic::Difference => cell.max - cell.min,
            BevStatistic::Accumulation => cell.n as f64,
            BevStatistic::Mean => cell.sum / cell.n as f64,
        };
        self.cells.iter().map(|cell| (cell.n > 0).then(|| value(cell))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bev_image_shows_each_statistic_and_marks_cells_without_points() {
        let grid = BevGrid::covering([0.0, 0.0], [1.0, 1.0], 1.0, 100).expect("fits");
        let mut values = BevValues::new(grid);
        for (x, y, value) in [(0.5, 0.5, 1.0), (0.6, 0.4, -4.0), (0.7, 0.4, 9.0), (1.5, 0.5, 7.0)] {
            assert!(values.add(x, y, value));
        }
        for (x, y, value) in [(9.0, 0.0, 1.0), (f64::NAN, 0.0, 1.0), (0.5, 0.5, f64::NAN), (0.5, 0.5, f64::INFINITY)] {
            assert!(!values.add(x, y, value), "{x} {y} {value}");
        }
        assert_eq!(values.image(BevStatistic::Max), [Some(9.0), None, Some(7.0), None]);
        assert_eq!(values.image(BevStatistic::Min), [Some(-4.0), None, Some(7.0), None]);
        assert_eq!(values.image(BevStatistic::Difference), [Some(13.0), None, Some(0.0), None]);
        assert_eq!(values.image(BevStatistic::Accumulation), [Some(3.0), None, Some(1.0), None]);
        assert_eq!(values.image(BevStatistic::Mean), [Some(2.0), None, Some(7.0), None]);
    }
}
