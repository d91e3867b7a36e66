//! Spheres of a cloud (thesis 6.3.2); prediction uses the spheres of a regular grid.

use super::cells::is_valid;
use crate::SegmentationError;
use neighbors::{SpatialIndex, VoxelGrid};
use serde::{Deserialize, Serialize};

/// Radius and overlap of the spheres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SphereSettings {
    /// Radius, m.
    pub radius_m: f32,
    /// Overlap of neighboring spheres of the grid for prediction, m. Their centers are `2 * radius_m - overlap_m` apart.
    pub overlap_m: f32,
}

impl Default for SphereSettings {
    fn default() -> Self {
        Self { radius_m: 10.0, overlap_m: 10.0 / 3.0 }
    }
}

impl SphereSettings {
    /// The first violated rule, if any.
    pub fn problem(&self) -> Option<String> {
        // Both are false for NaN.
        if !(1e-3..=1e4).contains(&self.radius_m) {
            return Some(format!("radius_m = {}; must be 0.001 to 10000", self.radius_m));
        }
        let overlaps = self.overlap_m >= 0.0 && self.overlap_m <= 1.9 * self.radius_m;
        (!overlaps).then(|| format!("overlap_m = {}; must be 0 to 1.9 radii", self.overlap_m))
    }
    fn check(self) -> Result<(), SegmentationError> {
        self.problem().map_or(Ok(()), |problem| Err(SegmentationError::Settings(problem)))
    }
    /// Centers of spheres that contain all points: spheres of a cubic grid, in the order of their first points, then
    /// spheres around points that no sphere of the grid contains. The grid starts at 0, so equal positions get equal
    /// spheres in every cloud.
    ///
    /// # Errors
    /// If the settings are invalid.
    pub fn centers(&self, points: &[[f32; 3]]) -> Result<Vec<[f32; 3]>, SegmentationError> {
        self.check()?;
        let spacing = 2.0 * self.radius_m - self.overlap_m;
        let index = SpatialIndex::new(points);
        let mut covered = vec![false; points.len()];
        let mut centers = Vec::new();
        let mut cover = |center: [f32; 3], covered: &mut [bool]| {
            let members = index.within_of_each(&[center], self.radius_m);
            members.get(0).iter().for_each(|point| covered[*point as usize] = true);
            if !members.get(0).is_empty() {
                centers.push(center);
            }
        };
        for point in first_points(points, spacing)? {
            let middle = |v: f32| ((f64::from(v) / f64::from(spacing)).floor() + 0.5) * f64::from(spacing);
            cover(points[point as usize].map(|v| middle(v) as f32), &mut covered);
        }
        // If the overlap is small, the corners of the cells are outside all spheres.
        loop {
            let is_open = |point: &usize| !covered[*point] && is_valid(points[*point]);
            let open: Vec<usize> = (0..points.len()).filter(is_open).collect();
            if open.is_empty() {
                return Ok(centers);
            }
            let positions: Vec<[f32; 3]> = open.iter().map(|point| points[*point]).collect();
            for first in first_points(&positions, self.radius_m)? {
                if !covered[open[first as usize]] {
                    cover(positions[first as usize], &mut covered);
                }
            }
        }
    }
}

/// The first point of each cell of a grid.
fn first_points(points: &[[f32; 3]], cell_m: f32) -> Result<Vec<u32>, SegmentationError> {
    let grid = VoxelGrid::new(points, cell_m).map_err(|error| SegmentationError::Settings(error.to_string()))?;
    Ok(grid.first_points())
}

/// Numbers of the points of a sphere, in Morton order.
pub fn sphere(index: &SpatialIndex, center: [f32; 3], radius_m: f32) -> Vec<u32> {
    index.within_of_each(&[center], radius_m).get(0).to_vec()
}
