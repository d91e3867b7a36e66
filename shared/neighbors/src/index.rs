//! The spatial index.

use crate::blocks::{BLOCK, Block};
use crate::morton::{Entry, MortonGrid};
use crate::position::{Bounds, is_valid};
use crate::tree::Tree;
use rayon::prelude::*;

/// A point in the neighborhood of a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// Number of the point in the cloud.
    pub index: u32,
    /// Squared distance, m².
    pub squared_m2: f32,
}

/// Points in Morton order under a tree of bounding boxes.
#[derive(Clone, Debug)]
pub struct SpatialIndex {
    pub(crate) tree: Tree,
    /// Point numbers in Morton order, followed by a block of padding, so that slots of the last block can be read.
    order: Vec<u32>,
    pub(crate) grid: MortonGrid,
    n_cloud: usize,
}

impl SpatialIndex {
    /// Indexes a cloud, on all threads of the current pool.
    ///
    /// # Panics
    /// If the cloud has 2^31 points or more.
    pub fn new(points: &[[f32; 3]]) -> Self {
        assert!(points.len() < 1 << 31, "{} points: point numbers have 31 bits", points.len());
        let bounds = points
            .par_iter()
            .with_min_len(1 << 14)
            .filter(|p| is_valid(**p))
            .map(|&p| Bounds { low: p, high: p })
            .reduce(|| Bounds::EMPTY, Bounds::union);
        let grid = MortonGrid::from_bounds(bounds);
        let mut entries: Vec<Entry> = points
            .par_iter()
            .with_min_len(1 << 14)
            .enumerate()
            .filter(|(_, p)| is_valid(**p))
            .map(|(point_idx, p)| Entry { code: grid.code(*p), point: point_idx as u32 })
            .collect();
        entries.par_sort_unstable();
        let tree = Tree::over(points, &mut entries);
        let mut order: Vec<u32> = Vec::with_capacity(entries.len() + BLOCK);
        order.extend(entries.iter().map(|entry| entry.point));
        order.extend([u32::MAX; BLOCK]);
        Self { tree, order, grid, n_cloud: points.len() }
    }
    /// Number of indexed points, which are the points of the cloud with valid coordinates.
    pub fn len(&self) -> usize {
        self.order.len() - BLOCK
    }
    /// Whether no point is indexed.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Number of points of the cloud, including points that are not indexed.
    pub fn n_cloud(&self) -> usize {
        self.n_cloud
    }
    /// Numbers of the indexed points in Morton order.
    pub fn order(&self) -> &[u32] {
        &self.order[..self.len()]
    }
    /// Point numbers starting at an index of the order, one for each slot of a block.
    #[inline(always)]
    pub(crate) fn slots(&self, start: u32) -> &[u32] {
        &self.order[start as usize..start as usize + BLOCK]
    }
    /// Positions of the indexed points in Morton order.
    pub(crate) fn positions(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        self.tree.blocks.iter().flat_map(Block::positions)
    }
}
