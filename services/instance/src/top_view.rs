//! The part of the top-down view around the things of a submap.

use geometry::BevGrid;
use messages::{ClassRow, GROUND_CLASSES, SubmapPoint};
use morphology::fill_gaps;
use ndarray::Array2;

/// Cells at most: 64 MiB of heights, 400 m x 400 m in cells of 0.1 m. Wider views get larger cells.
const MAX_CELLS: usize = 1 << 24;

/// How far around the things ground and other points are looked at, m: enough to bridge the shadow of a truck.
const MARGIN_M: f64 = 5.0;

/// Grid, terrain and what was seen where.
pub(crate) struct TopView {
    pub(crate) grid: BevGrid,
    /// Height of the ground in each cell (DEM), m; `None` if the view has no ground.
    pub(crate) terrain_m: Option<Array2<f32>>,
    /// Cells with a ground point.
    pub(crate) ground: Array2<bool>,
    /// Cells with any point.
    pub(crate) seen: Array2<bool>,
}

impl TopView {
    /// `None` if no point is of a thing class, or the things are too far apart for any grid.
    pub(crate) fn around(
        points: &[SubmapPoint],
        classes: &[ClassRow],
        is_thing: impl Fn(u8) -> bool,
        cell_m: f64,
    ) -> Option<Self> {
        let things = points.iter().zip(classes).filter(|(point, row)| is_thing(row.class_id) && is_finite(point));
        let nothing = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (min, max) = things.fold(nothing, |(min, max), (point, _)| {
            let xy = [f64::from(point.x), f64::from(point.y)];
            ([min[0].min(xy[0]), min[1].min(xy[1])], [max[0].max(xy[0]), max[1].max(xy[1])])
        });
        let (min, max) = (min.map(|v| v - MARGIN_M), max.map(|v| v + MARGIN_M));
        let grid = BevGrid::covering_coarsened(min, max, cell_m, MAX_CELLS)?;

        let shape = (grid.rows, grid.cols);
        let mut lowest_m = Array2::from_elem(shape, f32::INFINITY);
        let mut seen = Array2::from_elem(shape, false);
        for (point, row) in points.iter().zip(classes) {
            let Some(cell) = cell_of(&grid, point) else { continue };
            seen[cell] = true;
            if is_ground(row.class_id) {
                lowest_m[cell] = point.z.min(lowest_m[cell]);
            }
        }
        let ground = lowest_m.mapv(f32::is_finite);
        let terrain_m = fill_gaps(&lowest_m, &ground);
        Some(Self { grid, terrain_m, ground, seen })
    }

    /// Whether the point is at most `max_height_m` above the ground, or there is no ground to measure from.
    pub(crate) fn is_below(&self, point: &SubmapPoint, cell: (usize, usize), max_height_m: f32) -> bool {
        self.terrain_m.as_ref().is_none_or(|terrain| point.z - terrain[cell] <= max_height_m)
    }
}

/// Row and column of a point, `None` outside or if a coordinate is no number.
pub(crate) fn cell_of(grid: &BevGrid, point: &SubmapPoint) -> Option<(usize, usize)> {
    grid.cell(f64::from(point.x), f64::from(point.y)).filter(|_| point.z.is_finite())
}

fn is_finite(point: &SubmapPoint) -> bool {
    [point.x, point.y, point.z].iter().all(|v| v.is_finite())
}

fn is_ground(class_id: u8) -> bool {
    GROUND_CLASSES.iter().any(|&class| class as u8 == class_id)
}
