//! The elevation grid: the lowest point of every cell.

use crate::Settings;
use geometry::BevGrid;
use messages::{MAX_SWEEPS_PER_SUBMAP, SubmapHeader, SubmapPoint};
use ndarray::Array2;

/// Largest number of cells: 64 MiB of heights, 400 m x 400 m in cells of 0.1 m.
const MAX_CELLS: usize = 1 << 24;

/// The top view of a submap.
pub(crate) struct Elevation {
    pub(crate) grid: BevGrid,
    /// Lowest z of each cell, m; infinity without a point.
    pub(crate) lowest_m: Array2<f32>,
    /// Flat index of the cell of each point; the number of cells for a point outside the grid.
    pub(crate) cells: Vec<u32>,
    /// Number of points without a cell.
    pub(crate) n_outside: usize,
}

impl Elevation {
    /// Creates the grid; `None` if no point is within the range of the settings.
    pub(crate) fn new(header: &SubmapHeader, points: &[SubmapPoint], settings: &Settings) -> Option<Self> {
        let region = Bounds::around_path(header, points)?.grown(settings.reach_m);
        let within = points.iter().filter(|point| region.contains(point));
        let bounds = within.fold(Bounds::NOTHING, |bounds, point| bounds.with(point.x, point.y));
        let grid = BevGrid::covering_coarsened(bounds.min, bounds.max, settings.cell_m, MAX_CELLS)?;

        let outside = grid.n_cells() as u32;
        let mut lowest_m = Array2::from_elem((grid.rows, grid.cols), f32::INFINITY);
        let lowest = lowest_m.as_slice_mut().expect("a new array is in standard layout");
        let mut n_outside = 0;
        let cells = points.iter().map(|point| {
            let cell = grid.cell(f64::from(point.x), f64::from(point.y)).filter(|_| point.z.is_finite());
            let Some((row, col)) = cell else {
                n_outside += 1;
                return outside;
            };
            let cell = row * grid.cols + col;
            lowest[cell] = lowest[cell].min(point.z);
            cell as u32
        });
        let cells = cells.collect();
        Some(Self { grid, lowest_m, cells, n_outside })
    }

    /// Ratio of the side of the cells to the side in the settings.
    pub(crate) fn coarsened(&self, settings: &Settings) -> u32 {
        (self.grid.cell_m / settings.cell_m).round() as u32
    }
}

/// A rectangle of x and y, m.
struct Bounds {
    min: [f64; 2],
    max: [f64; 2],
}

impl Bounds {
    const NOTHING: Self = Self { min: [f64::INFINITY; 2], max: [f64::NEG_INFINITY; 2] };

    /// Bounds of the positions of the LiDAR, or of the median point if the header has no positions. `None` without a
    /// finite point.
    ///
    /// The median is used instead of the mean because of outliers.
    fn around_path(header: &SubmapHeader, points: &[SubmapPoint]) -> Option<Self> {
        let path = sensor_positions(header);
        let path = path.fold(Self::NOTHING, |bounds, [x, y]| bounds.with(x, y));
        if path.min[0] <= path.max[0] {
            return Some(path);
        }
        let median = |coordinate: fn(&SubmapPoint) -> f32| {
            let mut values: Vec<f32> = points.iter().map(coordinate).filter(|v| v.is_finite()).collect();
            let middle = values.len() / 2;
            (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
        };
        Some(Self::NOTHING.with(median(|point| point.x)?, median(|point| point.y)?))
    }
    fn with(self, x: f32, y: f32) -> Self {
        let x = f64::from(x);
        let y = f64::from(y);
        Self { min: [self.min[0].min(x), self.min[1].min(y)], max: [self.max[0].max(x), self.max[1].max(y)] }
    }
    fn grown(self, margin: f64) -> Self {
        Self { min: self.min.map(|v| v - margin), max: self.max.map(|v| v + margin) }
    }
    /// `false` for a point with a NaN coordinate.
    fn contains(&self, point: &SubmapPoint) -> bool {
        let x = f64::from(point.x);
        let y = f64::from(point.y);
        let inside = x >= self.min[0] && x <= self.max[0] && y >= self.min[1] && y <= self.max[1];
        inside && point.z.is_finite()
    }
}

fn sensor_positions(header: &SubmapHeader) -> impl Iterator<Item = [f32; 2]> {
    let n_sweeps = (header.n_sweeps as usize).min(MAX_SWEEPS_PER_SUBMAP);
    let poses =
        header.sweeps[..n_sweeps].iter().flat_map(|sweep| [sweep.submap_from_lidar_begin, sweep.submap_from_lidar_end]);
    poses.map(|pose| [pose[0], pose[1]]).filter(|position| position.iter().all(|v| v.is_finite()))
}
