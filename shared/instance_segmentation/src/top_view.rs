//! The top-down view around the objects of a submap.

use geometry::BevGrid;
use messages::{ClassRow, GROUND_CLASSES, SubmapPoint};
use morphology::fill_gaps;
use ndarray::Array2;

/// Largest number of cells: 64 MiB of heights, 400 m x 400 m in cells of 0.1 m. Larger views get larger cells.
const MAX_CELLS: usize = 1 << 24;

/// Margin around the objects, m: enough to interpolate the ground in the shadow of a truck.
const MARGIN_M: f64 = 5.0;

/// Row and column.
pub type Cell = (usize, usize);

/// Grid, terrain and observed cells.
pub struct TopView {
    /// The grid, in the submap frame.
    pub grid: BevGrid,
    /// Digital terrain model: height of the ground in each cell, m. `None` if the view has no ground.
    pub terrain_m: Option<Array2<f32>>,
    /// Cells with a ground point.
    pub ground: Array2<bool>,
    /// Cells with any point.
    pub seen: Array2<bool>,
    /// The points of the classes of `things`, in the order of the submap.
    pub thing_points: Vec<ThingPoint>,
}

/// A point of an object's class.
#[derive(Clone, Copy)]
pub struct ThingPoint {
    /// Its index in the submap.
    pub point_idx: u32,
    /// Its cell of the grid.
    pub cell: Cell,
}

impl TopView {
    /// Creates the view; `None` if there is no point of these classes, or the points are too far apart for any grid.
    pub fn around(points: &[SubmapPoint], classes: &[ClassRow], is_thing: &[bool; 256], cell_m: f64) -> Option<Self> {
        let is_thing = |row: &ClassRow| is_thing[usize::from(row.class_id)];
        let things = points.iter().zip(classes).filter(|(point, row)| is_thing(row) && is_finite(point));
        let empty = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let (min, max) = things.fold(empty, |(min, max), (point, _)| {
            ([min[0].min(point.x), min[1].min(point.y)], [max[0].max(point.x), max[1].max(point.y)])
        });
        let min = min.map(|v| f64::from(v) - MARGIN_M);
        let max = max.map(|v| f64::from(v) + MARGIN_M);
        let grid = BevGrid::covering_coarsened(min, max, cell_m, MAX_CELLS)?;

        let shape = (grid.rows, grid.cols);
        // NaN = no point, infinite = no ground point. One array instead of two, because most accesses miss the cache.
        let mut lowest_m = Array2::from_elem(shape, f32::NAN);
        let lowest = lowest_m.as_slice_mut().expect("a new array is in standard layout");
        let mut thing_points = Vec::new();
        let ground_classes: [bool; 256] =
            std::array::from_fn(|id| GROUND_CLASSES.iter().any(|&class| class as usize == id));
        for (point_idx, (point, row)) in points.iter().zip(classes).enumerate() {
            let Some(cell) = cell_of(&grid, point) else { continue };
            let lowest = &mut lowest[cell.0 * grid.cols + cell.1];
            let is_ground = ground_classes[usize::from(row.class_id)];
            // The minimum of a number and NaN is the number.
            *lowest = lowest.min(if is_ground { point.z } else { f32::INFINITY });
            if !is_ground && is_thing(row) {
                thing_points.push(ThingPoint { point_idx: point_idx as u32, cell });
            }
        }
        let seen = lowest_m.mapv(|z| !z.is_nan());
        let ground = lowest_m.mapv(f32::is_finite);
        let terrain_m = fill_gaps(&lowest_m, &ground);
        Some(Self { grid, terrain_m, ground, seen, thing_points })
    }

    /// Height of a point above the ground, m; above the origin of the submap if the view has no ground.
    pub fn above_ground(&self, point: &SubmapPoint, cell: Cell) -> f32 {
        point.z - self.terrain_m.as_ref().map_or(0.0, |terrain| terrain[cell])
    }

    /// A length in cells, rounded.
    pub fn in_cells(&self, length_m: f64) -> usize {
        (length_m / self.grid.cell_m).round() as usize
    }
}

/// Row and column of a point, `None` outside the grid and for coordinates that are not finite.
fn cell_of(grid: &BevGrid, point: &SubmapPoint) -> Option<Cell> {
    grid.cell(f64::from(point.x), f64::from(point.y)).filter(|_| point.z.is_finite())
}

fn is_finite(point: &SubmapPoint) -> bool {
    [point.x, point.y, point.z].iter().all(|v| v.is_finite())
}
