//! Prediction of a cloud, region by region, and the votes of the regions at each point.

use super::batch::PointBatch;
use super::parameters::Parameters;
use super::pass::Pass;
use super::spec::PointNetworkSpec;
use super::spheres::{SphereSettings, sphere};
use super::squares::{Region, SquareSettings};
use crate::SegmentationError;
use kernels::points::tensor;
use neighbors::SpatialIndex;
use rayon::prelude::*;

/// A network with its parameters, and the settings of its prediction.
#[derive(Clone, Copy)]
pub struct CloudPrediction<'a> {
    /// The network.
    pub network: &'a PointNetworkSpec,
    /// Its parameters.
    pub parameters: &'a Parameters,
    /// Regions that it processes at a time.
    pub regions: Regions,
    /// Divisor of the scores before they become probabilities.
    pub temperature: f32,
    /// Seed of [`PointNetworkSpec::plan`].
    pub seed: u64,
}

/// Regions of a cloud that a network processes at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Regions {
    /// Spheres of a regular grid.
    Spheres(SphereSettings),
    /// Squares in the horizontal plane.
    Squares(SquareSettings),
}

impl Regions {
    /// The regions of a cloud. Each valid point is in at least one.
    fn covering<'a>(
        self,
        positions: &'a [[f32; 3]],
    ) -> Result<Box<dyn Iterator<Item = Region> + 'a>, SegmentationError> {
        Ok(match self {
            Self::Spheres(spheres) => {
                let index = SpatialIndex::new(positions);
                let centers = spheres.centers(positions)?.into_iter();
                Box::new(centers.map(move |center| Region { center, points: sphere(&index, center, spheres.radius_m) }))
            }
            Self::Squares(squares) => Box::new(squares.squares(positions)?.into_iter()),
        })
    }
}

/// The input of a network for a region.
#[derive(Clone, Debug, PartialEq)]
pub struct RegionInput {
    /// Positions of the points relative to the center of the region, m.
    pub positions: Vec<[f32; 3]>,
    /// Features, one point after the other.
    pub features: Vec<f32>,
}

/// Largest number of regions, and of their points, that are predicted at a time. The memory of a prediction grows with
/// them.
const REGIONS_AT_A_TIME: usize = 8;
const POINTS_AT_A_TIME: usize = 1 << 17;

impl CloudPrediction<'_> {
    /// Mean probability of each class at each point, over the regions that contain it. Points with invalid coordinates,
    /// and single points of a region, get 0. `input` returns the input of a region.
    ///
    /// # Errors
    /// If settings, network or rows do not fit each other.
    pub fn per_point(
        &self,
        positions: &[[f32; 3]],
        input: impl Fn(&Region) -> RegionInput + Sync,
    ) -> Result<Vec<f32>, SegmentationError> {
        let mut votes = Votes::new(positions.len(), self.network.outputs());
        let mut regions = self.regions.covering(positions)?.peekable();
        while regions.peek().is_some() {
            let mut together = Vec::new();
            let mut n_points = 0;
            while let Some(region) =
                regions.next_if(|_| together.len() < REGIONS_AT_A_TIME && n_points < POINTS_AT_A_TIME)
            {
                n_points += region.points.len();
                // A single point has no neighbors.
                if region.points.len() > 1 {
                    together.push(region);
                }
            }
            let scores = |region: &Region| self.scores(input(region));
            let scores: Vec<Vec<f32>> = together.par_iter().map(scores).collect::<Result<_, _>>()?;
            for (region, scores) in together.iter().zip(scores) {
                votes.add(&region.points, &scores);
            }
        }
        Ok(votes.means())
    }
    fn scores(&self, input: RegionInput) -> Result<Vec<f32>, SegmentationError> {
        let RegionInput { positions, features } = input;
        let n = positions.len();
        let inputs = self.network.inputs();
        if features.len() != n * inputs {
            let found = features.len() / inputs.max(1);
            let expected = n;
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
    /// Creates an empty sum.
    pub fn new(n_points: usize, n_classes: usize) -> Self {
        Self { n_classes, sums: vec![0.0; n_points * n_classes], counts: vec![0; n_points] }
    }
    /// Adds the scores of points as probabilities (softmax).
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
