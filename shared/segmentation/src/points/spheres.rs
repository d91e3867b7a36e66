//! Spheres of a cloud (thesis 6.3.2): training spheres of all classes, and spheres of a regular grid whose votes are averaged.

use super::batch::PointBatch;
use super::ops::tensor;
use super::parameters::Parameters;
use super::pass::Pass;
use super::spec::PointNetworkSpec;
use crate::SegmentationError;
use neighbors::{LIMIT_M, SpatialIndex, VoxelGrid};
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

fn is_valid(point: [f32; 3]) -> bool {
    point.iter().all(|v| v.abs() <= LIMIT_M)
}

/// The first point of each cell of a grid.
fn first_points(points: &[[f32; 3]], cell_m: f32) -> Result<Vec<u32>, SegmentationError> {
    let grid = VoxelGrid::new(points, cell_m).map_err(|error| SegmentationError::Settings(error.to_string()))?;
    Ok(grid.first_points())
}

/// Centers of training spheres by class.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TrainingSpheres {
    /// Points of each class.
    points: BTreeMap<u8, Vec<u32>>,
}

impl TrainingSpheres {
    /// The points with a class are possible centers.
    pub fn new(classes: impl IntoIterator<Item = Option<u8>>) -> Self {
        let mut points: BTreeMap<u8, Vec<u32>> = BTreeMap::new();
        for (point, class) in classes.into_iter().enumerate() {
            if let Some(class) = class {
                points.entry(class).or_default().push(point as u32);
            }
        }
        Self { points }
    }
    /// Center points of an epoch: each class that the cloud has is the center's equally often, but for one sphere; the order is random.
    pub fn epoch(&self, n: usize, random: &mut Random) -> Vec<u32> {
        let lists: Vec<&Vec<u32>> = self.points.values().collect();
        if lists.is_empty() {
            return Vec::new();
        }
        // Random classes get the rest.
        let classes = random.permutation(lists.len());
        let centers: Vec<u32> = (0..n).map(|i| *random.pick(lists[classes[i % lists.len()]])).collect();
        random.permutation(n).into_iter().map(|i| centers[i]).collect()
    }
}

/// Numbers of the points of a sphere, in Morton order.
pub fn sphere(index: &SpatialIndex, center: [f32; 3], radius_m: f32) -> Vec<u32> {
    index.within_of_each(&[center], radius_m).of(0).to_vec()
}

/// A cloud with the features that a network needs.
#[derive(Clone, Copy, Debug)]
pub struct PointCloud<'a> {
    /// Positions, m.
    pub positions: &'a [[f32; 3]],
    /// Features of all points, one point after the other.
    pub features: &'a [f32],
}

/// Mean probability of each class at each point, over the spheres that contain it. Points with coordinates that are not valid get 0.
///
/// Each sphere is predicted around its center. The seed is that of [`PointNetworkSpec::plan`].
///
/// # Errors
/// If settings, network or cloud do not fit each other.
pub fn predict_spheres(
    spec: &PointNetworkSpec,
    parameters: &Parameters,
    cloud: PointCloud<'_>,
    settings: SphereSettings,
    seed: u64,
) -> Result<Vec<f32>, SegmentationError> {
    let (inputs, outputs) = spec.channels();
    let n = cloud.positions.len();
    if cloud.features.len() != n.saturating_mul(inputs) {
        let (found, expected) = (cloud.features.len() / inputs.max(1), n);
        return Err(SegmentationError::Length { column: "features", found, expected });
    }
    let mut votes = Votes::new(n, outputs);
    let index = SpatialIndex::new(cloud.positions);
    for center in settings.centers(cloud.positions)? {
        let members = sphere(&index, center, settings.radius_m);
        let around = |point: &u32| {
            let position = cloud.positions[*point as usize];
            std::array::from_fn(|axis| position[axis] - center[axis])
        };
        let positions = members.iter().map(around).collect();
        let features = members.iter().flat_map(|p| &cloud.features[*p as usize * inputs..(*p as usize + 1) * inputs]);
        let features = tensor(features.copied().collect(), (members.len(), inputs))?;
        let plan = match spec.plan(PointBatch::new(positions, vec![members.len()])?, seed) {
            // A single point has no neighbors: it gets no vote of this sphere.
            Err(SegmentationError::Settings(_)) if members.len() == 1 && spec.problem().is_none() => continue,
            plan => plan?,
        };
        let scores = spec.run(&mut Pass::evaluation(parameters), &plan, &features)?;
        votes.add(&members, &scores.flatten_all()?.to_vec1::<f32>()?);
    }
    Ok(votes.means())
}

/// Sums of the probabilities of each point.
pub struct Votes {
    n_classes: usize,
    sums: Vec<f32>,
    counts: Vec<u32>,
}

impl Votes {
    /// No votes.
    pub fn new(n_points: usize, n_classes: usize) -> Self {
        Self { n_classes, sums: vec![0.0; n_points * n_classes], counts: vec![0; n_points] }
    }
    /// Adds the scores of points as probabilities: their exponentials, divided by the sum of these.
    pub fn add(&mut self, points: &[u32], scores: &[f32]) {
        for (point, scores) in points.iter().zip(scores.chunks_exact(self.n_classes.max(1))) {
            let largest = scores.iter().fold(f32::NEG_INFINITY, |largest, score| largest.max(*score));
            let exponentials: Vec<f32> = scores.iter().map(|score| (score - largest).exp()).collect();
            let sum: f32 = exponentials.iter().sum();
            let sums = &mut self.sums[*point as usize * self.n_classes..(*point as usize + 1) * self.n_classes];
            sums.iter_mut().zip(exponentials).for_each(|(total, e)| *total += e / sum);
            self.counts[*point as usize] += 1;
        }
    }
    /// The mean probabilities; 0 for points without votes.
    pub fn means(mut self) -> Vec<f32> {
        for (sums, count) in self.sums.chunks_exact_mut(self.n_classes.max(1)).zip(&self.counts) {
            for sum in sums {
                *sum /= (*count).max(1) as f32;
            }
        }
        self.sums
    }
}
