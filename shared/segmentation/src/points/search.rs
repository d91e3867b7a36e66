//! Neighborhoods in the clouds of a batch.

use super::batch::ranges;
use crate::SegmentationError;
use kernels::points::Lists;
use neighbors::{Neighbor, SpatialIndex, VoxelGrid};

/// Clouds of a batch at one resolution, with their indices.
pub(super) struct Clouds {
    pub positions: Vec<[f32; 3]>,
    pub lengths: Vec<usize>,
    indices: Vec<SpatialIndex>,
}

impl Clouds {
    pub fn new(positions: Vec<[f32; 3]>, lengths: Vec<usize>) -> Self {
        let indices = ranges(&lengths).map(|range| SpatialIndex::new(&positions[range])).collect();
        Self { positions, lengths, indices }
    }
    /// Point numbers of all clouds, each cloud in Morton order.
    pub fn order(&self) -> Vec<u32> {
        let starts = ranges(&self.lengths).map(|range| range.start as u32);
        let orders = starts.zip(&self.indices);
        orders.flat_map(|(start, index)| index.order().iter().map(move |point| start + point)).collect()
    }
    /// The nearest points of this cloud within a radius of each query, nearest first, at most `k`.
    pub fn near(&self, queries: &Self, radius_m: f32, k: usize) -> Vec<Vec<u32>> {
        let within = self.nearest(queries, k, |squared| squared <= radius_m * radius_m);
        within.iter().map(|of_query| of_query.iter().map(|neighbor| neighbor.index).collect()).collect()
    }
    /// The `k` nearest points of this cloud around each query whose squared distances, m², are accepted, nearest first.
    pub fn nearest(&self, queries: &Self, k: usize, accept: impl Fn(f32) -> bool) -> Vec<Vec<Neighbor>> {
        let mut out = Vec::with_capacity(queries.positions.len());
        let mut start = 0;
        for (index, range) in self.indices.iter().zip(ranges(&queries.lengths)) {
            let n_queries = range.len();
            let found = index.nearest_of_each(&queries.positions[range], k);
            for query in 0..n_queries {
                let accepted = found.get(query).iter().take_while(|neighbor| accept(neighbor.squared_m2));
                let in_batch = accepted.map(|neighbor| Neighbor { index: start + neighbor.index, ..*neighbor });
                out.push(in_batch.collect());
            }
            start += index.n_cloud() as u32;
        }
        out
    }
    /// The `k` nearest other points of each point, nearest first.
    pub fn neighbors(&self, k: usize) -> Lists {
        let found: Vec<_> = self.indices.iter().map(|index| index.nearest_of_own(k + 1)).collect();
        let starts = ranges(&self.lengths).map(|range| range.start as u32);
        let lists = starts.zip(&found).flat_map(|(start, found)| {
            // The first is the point itself, or a copy of it.
            let others = move |point| found.get(point).iter().skip(1).map(move |neighbor| start + neighbor.index);
            (0..found.len()).map(others)
        });
        Lists::new(lists, self.positions.len())
    }
    /// The barycenters of the occupied voxels of each cloud.
    pub fn subsampled(&self, cell_m: f32) -> Result<Self, SegmentationError> {
        let mut positions = Vec::new();
        let mut lengths = Vec::new();
        for range in ranges(&self.lengths) {
            let cloud = &self.positions[range];
            let grid = VoxelGrid::new(cloud, cell_m).map_err(|error| SegmentationError::Settings(error.to_string()))?;
            positions.extend(grid.barycenters(cloud));
            lengths.push(grid.len());
        }
        Ok(Self::new(positions, lengths))
    }
    /// Farthest point sampling of each cloud: each point is the farthest from the previous ones. At least one point of
    /// each cloud.
    pub fn farthest(&self, n: usize, seed: u64) -> Vec<u32> {
        let starts = ranges(&self.lengths).map(|range| range.start as u32);
        let samples = starts.zip(&self.indices);
        samples.flat_map(|(start, index)| index.farthest_points(n, seed).into_iter().map(move |p| start + p)).collect()
    }
    /// The points with these numbers, in the order of their clouds.
    pub fn chosen(&self, points: &[u32]) -> Self {
        let positions = points.iter().map(|point| self.positions[*point as usize]).collect();
        let of_cloud =
            |range: std::ops::Range<usize>| points.iter().filter(|p| range.contains(&(**p as usize))).count();
        Self::new(positions, ranges(&self.lengths).map(of_cloud).collect())
    }
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }
}

/// The 3 nearest coarse points of each fine point, with inverse squared distances as weights that sum to 1.
pub(super) struct Interpolation {
    pub nearest: Lists,
    /// A weight for each item of the lists.
    pub weights: Vec<f32>,
}

/// Interpolation from a coarse to a fine cloud.
pub(super) fn interpolation(fine: &Clouds, coarse: &Clouds) -> Interpolation {
    let found = coarse.nearest(fine, 3, |_| true);
    let weights = found.iter().flat_map(|of_point| {
        let inverse: Vec<f32> = of_point.iter().map(|neighbor| 1.0 / (neighbor.squared_m2 + 1e-8)).collect();
        let sum: f32 = inverse.iter().sum();
        inverse.into_iter().map(move |inverse| inverse / sum)
    });
    let weights = weights.collect();
    let points = found.iter().map(|of_point| of_point.iter().map(|neighbor| neighbor.index));
    Interpolation { nearest: Lists::new(points, coarse.len()), weights }
}
