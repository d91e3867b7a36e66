//! Spheres of a cloud (thesis 6.3.2): training spheres of all classes, and spheres of a regular grid for prediction.

use super::cells::is_valid;
use crate::SegmentationError;
use neighbors::{SpatialIndex, VoxelGrid};
use random::Random;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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
    /// Centers of spheres that contain all points: those of a cubic grid, in the order of their first points, then points that no
    /// sphere of the grid contains. The grid starts at 0, so equal places get equal spheres in every cloud.
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
            members.of(0).iter().for_each(|point| covered[*point as usize] = true);
            if !members.of(0).is_empty() {
                centers.push(center);
            }
        };
        for point in first_points(points, spacing)? {
            let middle = |v: f32| ((f64::from(v) / f64::from(spacing)).floor() + 0.5) * f64::from(spacing);
            cover(points[point as usize].map(|v| middle(v) as f32), &mut covered);
        }
        // The corners of the cells are outside of all spheres, if the overlap is small.
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

/// What training spheres are drawn from, by class: points, or submaps that have points of a class.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainingSpheres {
    /// Items of each class, and the sum of their weights and of those before them.
    items: BTreeMap<u8, Vec<(u32, f64)>>,
}

impl TrainingSpheres {
    /// Adds an item of a class. An item of twice the weight is drawn twice as often as others of its class.
    pub fn add(&mut self, class: u8, item: u32, weight: f64) {
        let items = self.items.entry(class).or_default();
        let before = items.last().map_or(0.0, |(_, sum)| *sum);
        items.push((item, before + weight));
    }
    /// Class and item of a sphere of an epoch, counted from 0. Each class is drawn equally often, but for one sphere; the item is
    /// random. `None` without items.
    pub fn draw(&self, sphere: usize, random: &mut Random) -> Option<(u8, u32)> {
        let (class, items) = self.items.iter().nth(sphere % self.items.len().max(1))?;
        let (_, total) = items.last()?;
        let at = f64::from(random.unit()) * total;
        let place = items.partition_point(|(_, sum)| *sum <= at).min(items.len() - 1);
        Some((*class, items[place].0))
    }
}

/// Numbers of the points of a sphere, in Morton order.
pub fn sphere(index: &SpatialIndex, center: [f32; 3], radius_m: f32) -> Vec<u32> {
    index.within_of_each(&[center], radius_m).of(0).to_vec()
}
