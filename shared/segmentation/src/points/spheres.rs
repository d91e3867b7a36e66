//! Spheres of a cloud (thesis 6.3.2): training spheres of all classes, and spheres of a regular grid whose votes are averaged.

use super::batch::PointBatch;
use super::cells::is_valid;
use super::ops::tensor;
use super::parameters::Parameters;
use super::pass::Pass;
use super::spec::PointNetworkSpec;
use crate::SegmentationError;
use neighbors::{SpatialIndex, VoxelGrid};
use random::Random;
use rayon::prelude::*;
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

/// A network with its parameters, and how it predicts.
#[derive(Clone, Copy)]
pub struct SpherePrediction<'a> {
    /// The network.
    pub network: &'a PointNetworkSpec,
    /// Its parameters.
    pub parameters: &'a Parameters,
    /// The spheres that it sees.
    pub spheres: SphereSettings,
    /// Divisor of the scores before they become probabilities.
    pub temperature: f32,
    /// Seed of [`PointNetworkSpec::plan`].
    pub seed: u64,
}

/// Positions of the points of a sphere relative to its center, m, and their features.
pub type SphereRows = (Vec<[f32; 3]>, Vec<f32>);

/// Spheres, and points of them, that are predicted at a time at most. The memory of a prediction grows with them.
const SPHERES_AT_A_TIME: usize = 8;
const POINTS_AT_A_TIME: usize = 1 << 17;

impl SpherePrediction<'_> {
    /// Mean probability of each class at each point, over the spheres that contain it. Points with coordinates that are not valid,
    /// and points that are alone in their spheres, get 0. `rows` gives the input of a sphere from its center and its points.
    ///
    /// # Errors
    /// If settings, network or rows do not fit each other.
    pub fn of_cloud(
        &self,
        positions: &[[f32; 3]],
        rows: impl Fn([f32; 3], &[u32]) -> SphereRows + Sync,
    ) -> Result<Vec<f32>, SegmentationError> {
        let mut votes = Votes::new(positions.len(), self.network.channels().1);
        let index = SpatialIndex::new(positions);
        let mut centers = self.spheres.centers(positions)?.into_iter().peekable();
        while centers.peek().is_some() {
            let (mut spheres, mut n_points) = (Vec::new(), 0);
            while let Some(center) =
                centers.next_if(|_| spheres.len() < SPHERES_AT_A_TIME && n_points < POINTS_AT_A_TIME)
            {
                let members = sphere(&index, center, self.spheres.radius_m);
                n_points += members.len();
                // A single point has no neighbors.
                if members.len() > 1 {
                    spheres.push((center, members));
                }
            }
            let scores = |(center, members): &([f32; 3], Vec<u32>)| self.scores(rows(*center, members));
            let scores: Vec<Vec<f32>> = spheres.par_iter().map(scores).collect::<Result<_, _>>()?;
            for ((_, members), scores) in spheres.iter().zip(scores) {
                votes.add(members, &scores);
            }
        }
        Ok(votes.means())
    }
    fn scores(&self, (positions, features): SphereRows) -> Result<Vec<f32>, SegmentationError> {
        let (n, inputs) = (positions.len(), self.network.channels().0);
        if features.len() != n * inputs {
            let (found, expected) = (features.len() / inputs.max(1), n);
            return Err(SegmentationError::Length { column: "features", found, expected });
        }
        let features = tensor(features, (n, inputs))?;
        let plan = self.network.plan(PointBatch::new(positions, vec![n])?, self.seed)?;
        let scores = self.network.run(&mut Pass::evaluation(self.parameters), &plan, &features)?;
        let mut scores = scores.flatten_all()?.to_vec1::<f32>()?;
        for score in &mut scores {
            *score /= self.temperature;
        }
        Ok(scores)
    }
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
