//! One point for each occupied cell of a grid: the input of networks on points.

use crate::cell_probabilities::NO_CELL;
use crate::intensity::IntensityMap;
use crate::{ModelInput, SegmentationError};
use messages::SubmapPoint;
use neighbors::{LIMIT_M, VoxelGrid};

/// Points and the data for their features: a submap, or a sphere of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellCloud {
    /// Barycenters of the points of the cells, m.
    pub positions: Vec<[f32; 3]>,
    /// Mean heights above the ground, m; 0 without ground.
    pub heights_m: Vec<f32>,
    /// Mean intensities, 0 to 255; empty if they are unknown.
    pub intensities: Vec<f32>,
    /// Mean colors, 0 to 1; empty if they are unknown.
    pub colors: Vec<[f32; 3]>,
}

/// The cells of a submap, and the grid with the points of each.
#[derive(Clone, Debug)]
pub struct GriddedCells {
    /// The cells, in the order of their first points.
    pub cloud: CellCloud,
    /// The points of each cell.
    pub grid: VoxelGrid,
}

impl CellCloud {
    /// The cells of side `cell_m` of a submap. Points with invalid coordinates are in no cell.
    ///
    /// # Errors
    /// If the side of the cells is not a positive number.
    pub fn from_input(
        input: &ModelInput<'_>,
        heights_m: &[f32],
        intensities: &IntensityMap,
        cell_m: f32,
    ) -> Result<GriddedCells, SegmentationError> {
        let positions: Vec<[f32; 3]> = input.points.iter().map(|point| [point.x, point.y, point.z]).collect();
        let grid =
            VoxelGrid::new(&positions, cell_m).map_err(|error| SegmentationError::Settings(error.to_string()))?;
        let mean = |value: &dyn Fn(usize) -> f32| -> Vec<f32> {
            let of_cell = |cell: usize| {
                let points = grid.points_of(cell);
                points.iter().map(|point| value(*point as usize)).sum::<f32>() / points.len() as f32
            };
            (0..grid.len()).map(of_cell).collect()
        };
        let has_intensity =
            *intensities != IntensityMap::Unknown && input.points.iter().any(|point| point.intensity > 0);
        let cloud = Self {
            positions: grid.barycenters(&positions),
            heights_m: mean(&|point| if heights_m[point].is_nan() { 0.0 } else { heights_m[point] }),
            intensities: if has_intensity {
                mean(&|point| {
                    let SubmapPoint { ring, intensity, .. } = input.points[point];
                    f32::from(intensities.apply(usize::from(ring), intensity))
                })
            } else {
                Vec::new()
            },
            colors: input.colors.map_or(Vec::new(), |colors| {
                let channel = |value: fn(&messages::ColorRow) -> u8| mean(&|point| f32::from(value(&colors[point])));
                let [r, g, b] = [channel(|row| row.r), channel(|row| row.g), channel(|row| row.b)];
                r.iter().zip(g).zip(b).map(|((r, g), b)| [*r, g, b].map(|v| v / 255.0)).collect()
            }),
        };
        Ok(GriddedCells { cloud, grid })
    }
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }
    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
    /// Some of the points, with positions relative to `center`.
    #[must_use]
    pub fn around(&self, center: [f32; 3], points: &[u32]) -> Self {
        let chosen = |values: &[f32]| -> Vec<f32> {
            if values.is_empty() { Vec::new() } else { points.iter().map(|p| values[*p as usize]).collect() }
        };
        let position = |point: &u32| {
            let position = self.positions[*point as usize];
            std::array::from_fn(|axis| position[axis] - center[axis])
        };
        Self {
            positions: points.iter().map(position).collect(),
            heights_m: chosen(&self.heights_m),
            intensities: chosen(&self.intensities),
            colors: if self.colors.is_empty() {
                Vec::new()
            } else {
                points.iter().map(|p| self.colors[*p as usize]).collect()
            },
        }
    }
}

/// The cell of each of `n_points` points, [`NO_CELL`] for points without a cell.
pub(super) fn cell_of_each(grid: &VoxelGrid, n_points: usize) -> Vec<u32> {
    let mut cells = vec![NO_CELL; n_points];
    for cell in 0..grid.len() {
        grid.points_of(cell).iter().for_each(|point| cells[*point as usize] = cell as u32);
    }
    cells
}

/// Whether a network can use a position.
pub(super) fn is_valid(position: [f32; 3]) -> bool {
    position.iter().all(|v| v.abs() <= LIMIT_M)
}
