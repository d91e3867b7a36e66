//! Farthest point sampling (Eldar et al., IEEE Transactions on Image Processing 1997).

use crate::blocks::BLOCK;
use crate::index::SpatialIndex;
use crate::tree::{Child, Tree, WIDTH};
use random::Random;

impl SpatialIndex {
    /// Selects `n` points, each the farthest from the previous ones; of equally far points the one with the smallest
    /// number. The seed determines the first point. All indexed points if `n` is larger. A longer sample begins with
    /// the shorter one.
    pub fn farthest_points(&self, n: usize, seed: u64) -> Vec<u32> {
        let n = n.min(self.len());
        let mut sample = Vec::with_capacity(n);
        if n == 0 {
            return sample;
        }
        let mut place = Random::new(seed).index(self.len());
        let mut distances = Distances::new(self);
        sample.push(self.order()[place]);
        while sample.len() < n {
            let position = distances.position(place);
            distances.choose(0, place as u32, position);
            place = distances.farthest();
            sample.push(self.order()[place]);
        }
        sample
    }
}

/// Key of a point that is chosen or absent: smaller than all others.
const CHOSEN: u64 = 0;

/// Distance of each point to the nearest chosen one.
struct Distances<'a> {
    index: &'a SpatialIndex,
    tree: &'a Tree,
    /// Squared distances, m², by block; negative for chosen points and unused slots.
    squared: Vec<[f32; BLOCK]>,
    /// The largest key below each child of each node.
    farthest: Vec<[u64; WIDTH]>,
}

impl<'a> Distances<'a> {
    /// Initial state without chosen points: all points are infinitely far from the chosen ones.
    fn new(index: &'a SpatialIndex) -> Self {
        let tree = &index.tree;
        let of_block = |n: u32| std::array::from_fn(|slot| if slot < n as usize { f32::INFINITY } else { -1.0 });
        let infinite = u64::from(f32::INFINITY.to_bits()) << 32;
        Self {
            index,
            tree,
            squared: tree.blocks.iter().map(|block| of_block(block.n)).collect(),
            farthest: tree
                .nodes
                .iter()
                .map(|node| node.points.map(|p| if p == [0; 2] { CHOSEN } else { infinite }))
                .collect(),
        }
    }
    /// Position of the point at an index of the order.
    fn position(&self, place: usize) -> [f32; 3] {
        let block = &self.tree.blocks[self.tree.blocks.partition_point(|block| block.start as usize <= place) - 1];
        block.positions().nth(place - block.start as usize).expect("blocks cover the order")
    }
    /// Updates the distances below a node after the point at index `place` was chosen; returns the largest key.
    fn choose(&mut self, node_idx: usize, place: u32, position: [f32; 3]) -> u64 {
        let node = &self.tree.nodes[node_idx];
        let squared = node.squared_distances(position);
        for (slot, squared) in squared.into_iter().enumerate() {
            let [start, end] = node.points[slot];
            let holds_chosen = (start..end).contains(&place);
            // All points of the box are at least this far from the chosen one: no distance decreases.
            if !holds_chosen && u64::from(squared.to_bits()) >= self.farthest[node_idx][slot] >> 32 {
                continue;
            }
            self.farthest[node_idx][slot] = match Child::from_number(node.child[slot]) {
                Child::Node(child) => self.choose(child, place, position),
                Child::Block(block) => self.choose_in_block(block, place, position),
            };
        }
        self.farthest[node_idx].into_iter().fold(CHOSEN, u64::max)
    }
    #[inline(always)]
    fn choose_in_block(&mut self, block_idx: usize, place: u32, position: [f32; 3]) -> u64 {
        let block = &self.tree.blocks[block_idx];
        let squared = &mut self.squared[block_idx];
        for (squared, new) in squared.iter_mut().zip(block.squared_distances(position)) {
            *squared = if new < *squared { new } else { *squared };
        }
        if (block.start..block.start + block.n).contains(&place) {
            squared[(place - block.start) as usize] = -1.0;
        }
        let keys = squared.iter().zip(self.index.slots(block.start)).map(|(squared, point)| key(*squared, *point));
        keys.fold(CHOSEN, u64::max)
    }
    /// Index of the farthest point.
    fn farthest(&self) -> usize {
        let mut node_idx = 0;
        loop {
            let keys = &self.farthest[node_idx];
            let slot = (1..WIDTH).fold(0, |best, slot| if keys[slot] > keys[best] { slot } else { best });
            match Child::from_number(self.tree.nodes[node_idx].child[slot]) {
                Child::Node(child) => node_idx = child,
                Child::Block(block_idx) => {
                    let start = self.tree.blocks[block_idx].start;
                    let points = self.index.slots(start).iter().zip(&self.squared[block_idx]);
                    let is_farthest = |(point, squared): (&u32, &f32)| key(*squared, *point) == keys[slot];
                    return start as usize + points.map(is_farthest).position(|found| found).unwrap_or(0);
                }
            }
        }
    }
}

/// Orders by distance, then by descending point number.
#[inline(always)]
fn key(squared: f32, point: u32) -> u64 {
    if squared < 0.0 { CHOSEN } else { u64::from(squared.to_bits()) << 32 | u64::from(!point) }
}
