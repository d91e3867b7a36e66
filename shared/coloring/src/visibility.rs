//! Visible range of an exposure in each direction.

use crate::exposure::PosedExposure;
use ndarray::Array2;

/// Side of a cell, rad: about the spacing of shots along a ring of a spinning LiDAR at 10 Hz.
pub const CELL_RAD: f32 = 0.0035;

/// Cell index of a pixel outside every grid.
pub const NO_CELL: u32 = u32::MAX;

/// The cells into which the image of an exposure is divided.
#[derive(Clone, Copy, Debug)]
pub struct CellGrid {
    min: [f32; 2],
    cells_per_px: f32,
    columns: i32,
    rows: i32,
}

impl CellGrid {
    /// Cells of `CELL_RAD`, at least one pixel wide.
    pub fn new(exposure: &PosedExposure<'_>) -> Self {
        let cells_per_px = 1.0 / (CELL_RAD * exposure.lens.px_per_rad()).max(1.0);
        let [columns, rows] = [0, 1].map(|axis| ((exposure.max[axis] - exposure.min[axis]) * cells_per_px) as i32 + 1);
        Self { min: exposure.min, cells_per_px, columns, rows }
    }

    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.columns, self.rows].map(|n| n as usize)
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        (self.columns * self.rows) as usize
    }

    /// The cell of a pixel of the exposure. The result is arbitrary for pixels outside the image.
    #[inline(always)]
    pub fn cell(&self, u: f32, v: f32) -> u32 {
        // Truncation: rounding to the nearest integer would be slow, and the result is arbitrary outside the image.
        let column = ((u - self.min[0]) * self.cells_per_px) as i32;
        let row = ((v - self.min[1]) * self.cells_per_px) as i32;
        row.wrapping_mul(self.columns).wrapping_add(column) as u32
    }

    /// Side of a cell, px.
    pub fn cell_px(&self) -> f32 {
        self.cells_per_px.recip()
    }

    /// The pixel (u, v) in the middle of a cell.
    pub fn pixel(&self, cell: usize) -> [f32; 2] {
        let columns = self.columns as usize;
        let at = [cell % columns, cell / columns].map(|index| (index as f32 + 0.5) * self.cell_px());
        [self.min[0] + at[0], self.min[1] + at[1]]
    }
}

/// For every cell of an exposure, the largest range at which a point is still visible.
#[derive(Debug)]
pub struct VisibilityMap {
    /// The cells.
    pub grid: CellGrid,
    /// Largest visible range of each cell, m, row by row.
    max_range_m: Vec<f32>,
}

impl VisibilityMap {
    /// Takes the largest visible range of each cell, m, row by row.
    pub fn new(grid: CellGrid, max_range_m: Vec<f32>) -> Self {
        Self { grid, max_range_m }
    }

    /// A map without any occlusion.
    pub fn unobstructed() -> Self {
        let grid = CellGrid { min: [0.0; 2], cells_per_px: 0.0, columns: 1, rows: 1 };
        Self { grid, max_range_m: vec![f32::INFINITY] }
    }

    /// The largest range at which a point of the cell is visible, m. Minus infinity outside of the image.
    #[inline(always)]
    pub fn max_range_m(&self, cell: u32) -> f32 {
        self.max_range_m.get(cell as usize).copied().unwrap_or(f32::NEG_INFINITY)
    }

    /// For each row and column of cells, whether a surface limits the visible range.
    pub fn is_hit(&self) -> Array2<bool> {
        let [columns, _] = self.grid.size();
        Array2::from_shape_fn((self.max_range_m.len() / columns, columns), |(row, column)| {
            self.max_range_m[row * columns + column].is_finite()
        })
    }

    /// Whether a point of the camera frame that projects to pixel (u, v) is visible: in the image and not occluded.
    #[inline]
    pub fn sees(&self, exposure: &PosedExposure<'_>, p_in_camera: [f32; 3], [u, v]: [f32; 2]) -> bool {
        let range_m = p_in_camera.iter().map(|v| v * v).sum::<f32>().sqrt();
        exposure.contains(u, v) && range_m <= self.max_range_m(self.grid.cell(u, v))
    }
}
