//! Heights, roughness and ground points of a submap from its terrain.

use crate::elevation::Elevation;
use crate::parameters::{Parameters, Tolerance};
use crate::roughness::rough_cells;
use crate::terrain::terrain;
use messages::{ClassId, ClassRow, SubmapHeader, SubmapPoint};
use std::sync::Arc;

/// The ground below the points of a submap.
pub struct Ground {
    parameters: Parameters,
    n_points: usize,
    /// The grid; `None` if no point is within the range of the parameters.
    elevation: Option<Elevation>,
    /// Height of the terrain in every cell in raster order, m, and one element at infinity for points outside the grid;
    /// `None` if there is no ground.
    terrain_m: Option<Vec<f32>>,
}

/// The ground below a submap, and the heights of its points above it. Several models share it.
pub struct SubmapGround {
    /// The ground.
    pub ground: Ground,
    /// Height of every point above the terrain, m; NaN without terrain.
    pub heights_m: Vec<f32>,
}

impl SubmapGround {
    /// Finds the ground of a submap with the default parameters.
    pub fn find(header: &SubmapHeader, points: &[SubmapPoint]) -> Arc<Self> {
        let ground = Ground::find(header, points);
        let heights_m = ground.heights(points);
        Arc::new(Self { ground, heights_m })
    }
}

impl Ground {
    /// Finds the ground with the default parameters. The path of the LiDAR comes from the header, or from the points if
    /// there are no sweeps. `points` are in the frame of the submap, m: z is up within the tilt of the vehicle.
    pub fn find(header: &SubmapHeader, points: &[SubmapPoint]) -> Self {
        Self::find_with(header, points, Parameters::default())
    }
    /// Finds the ground with other parameters.
    pub fn find_with(header: &SubmapHeader, points: &[SubmapPoint], parameters: Parameters) -> Self {
        let elevation = Elevation::new(header, points, &parameters.settings);
        let terrain_m = elevation.as_ref().and_then(|elevation| terrain(elevation, &parameters));
        Self { parameters, n_points: points.len(), elevation, terrain_m }
    }
    /// The grid and its terrain, if ground was found.
    fn found(&self) -> Option<(&Elevation, &[f32])> {
        Some((self.elevation.as_ref()?, self.terrain_m.as_deref()?))
    }
    /// Number of points outside the grid: not finite, or too far from the path of the LiDAR.
    pub fn n_outside(&self) -> usize {
        self.elevation.as_ref().map_or(self.n_points, |elevation| elevation.n_outside)
    }
    /// Factor by which the cells were enlarged to limit the memory of the grid; 1 if they were not.
    pub fn coarsened(&self) -> u32 {
        self.elevation.as_ref().map_or(1, |elevation| elevation.coarsened(&self.parameters.settings))
    }
    /// Height of every point above the terrain, m. NaN without terrain. `points` are the points of the submap.
    pub fn heights(&self, points: &[SubmapPoint]) -> Vec<f32> {
        let heights = self.found().map(|(elevation, terrain_m)| heights_above(terrain_m, elevation, points));
        heights.unwrap_or_else(|| vec![f32::NAN; points.len()])
    }
    /// Whether the terrain below each point is rougher than ground. A low point is then on low vegetation.
    pub fn is_rough(&self) -> Vec<bool> {
        let is_rough = self.found().map(|(elevation, terrain_m)| {
            let is_rough = rough_ground(elevation, terrain_m, &self.parameters);
            elevation.cells.iter().map(|cell| is_rough[*cell as usize]).collect()
        });
        is_rough.unwrap_or_else(|| vec![false; self.n_points])
    }
    /// The class of every point by this method: ground with a score, or unlabeled. `heights_m` is the result of
    /// [`Self::heights`].
    pub fn classes(&self, heights_m: &[f32]) -> Vec<ClassRow> {
        let mut classes = vec![UNLABELED; self.n_points];
        if let Some((elevation, terrain_m)) = self.found() {
            mark_ground(heights_m, elevation, terrain_m, &self.parameters, &mut classes);
        }
        classes
    }
}

/// The class of a point that is not ground.
const UNLABELED: ClassRow = ClassRow { class_id: ClassId::Unlabeled as u8, score: 0 };

/// Heights above the terrain. NaN for points outside the grid, whose terrain is at infinity.
fn heights_above(terrain: &[f32], elevation: &Elevation, points: &[SubmapPoint]) -> Vec<f32> {
    let height = |(point, &cell): (&SubmapPoint, &u32)| {
        let height = point.z - terrain[cell as usize];
        if height.is_finite() { height } else { f32::NAN }
    };
    points.iter().zip(&elevation.cells).map(height).collect()
}

/// Assigns the class to ground points. The other rows are unchanged.
fn mark_ground(
    heights_m: &[f32],
    elevation: &Elevation,
    terrain: &[f32],
    parameters: &Parameters,
    classes: &mut [ClassRow],
) {
    let Tolerance { below_m, above_m, foot_m } = parameters.tolerance;
    let object_heights = above_m..parameters.settings.standing_m as f32;
    let mut has_object = vec![false; terrain.len()];
    for (height_m, &cell) in heights_m.iter().zip(&elevation.cells) {
        has_object[cell as usize] |= object_heights.contains(height_m);
    }
    let is_rough = rough_ground(elevation, terrain, parameters);
    for ((row, &height_m), &cell) in classes.iter_mut().zip(heights_m).zip(&elevation.cells) {
        let tolerance_m = match (height_m < 0.0, has_object[cell as usize]) {
            (true, _) => below_m,
            (false, true) => foot_m,
            (false, false) => above_m,
        };
        let off = height_m.abs() / tolerance_m;
        if off <= 1.0 && !is_rough[cell as usize] {
            let score = (255.0 - 127.5 * off).round() as u8;
            *row = ClassRow { class_id: ClassId::Ground as u8, score };
        }
    }
}

/// Whether the ground of each cell is rougher than ground can be, plus one element for points outside the grid.
fn rough_ground(elevation: &Elevation, terrain: &[f32], parameters: &Parameters) -> Vec<bool> {
    let Tolerance { below_m, above_m, .. } = parameters.tolerance;
    let mut ground_m = elevation.lowest_m.clone();
    for (lowest_m, terrain_m) in ground_m.iter_mut().zip(terrain) {
        if !(-below_m..=above_m).contains(&(*lowest_m - terrain_m)) {
            *lowest_m = f32::NAN;
        }
    }
    rough_cells(&ground_m, parameters.settings.rough_m as f32).into_iter().chain([false]).collect()
}
