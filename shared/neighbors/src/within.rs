//! Points within a radius.

use crate::batch::Search;
use crate::blocks::BLOCK;
use crate::candidates::{key, neighbor};
use crate::index::{Neighbor, SpatialIndex};
use crate::position::is_valid;
use crate::tree::{Child, WIDTH};

impl SpatialIndex {
    /// All points with `squared_distance <= radius_m * radius_m`, nearest first.
    pub fn within(&self, query: [f32; 3], radius_m: f32) -> Vec<Neighbor> {
        let mut keys = Vec::new();
        let mut take = |squared: &[f32; BLOCK], slots: &[u32], squared_radius: f32| {
            for (squared, point) in squared.iter().zip(slots) {
                if *squared <= squared_radius {
                    keys.push(key(*squared, *point));
                }
            }
        };
        if let Some(squared_radius) = squared_radius(query, radius_m) {
            let mut stack = vec![0];
            while let Some(child) = stack.pop() {
                match Child::from_number(child) {
                    Child::Block(block) => {
                        let block = &self.tree.blocks[block];
                        take(&block.squared_distances(query), self.slots(block.start), squared_radius);
                    }
                    Child::Node(node) => {
                        let node = &self.tree.nodes[node];
                        let squared = node.squared_distances(query);
                        stack.extend((0..WIDTH).filter(|slot| squared[*slot] <= squared_radius).map(|s| node.child[s]));
                    }
                }
            }
        }
        keys.sort_unstable();
        keys.into_iter().map(neighbor).collect()
    }
}

/// The squared radius; `None` if nothing can be found. It is finite, so unused slots are outside.
fn squared_radius(query: [f32; 3], radius_m: f32) -> Option<f32> {
    (is_valid(query) && radius_m >= 0.0).then(|| (radius_m * radius_m).min(f32::MAX))
}

/// Marks an entry of the stack whose points are all within the radius: indices of the order instead of a child.
const ALL: u64 = 1 << 63;

/// Searches within a radius. It finds the numbers of points, in Morton order.
pub(crate) struct WithinSearch<'a> {
    index: &'a SpatialIndex,
    radius_m: f32,
    stack: Vec<u64>,
}

impl<'a> WithinSearch<'a> {
    pub fn new(index: &'a SpatialIndex, radius_m: f32) -> Self {
        Self { index, radius_m, stack: Vec::with_capacity(64) }
    }
}

impl Search for WithinSearch<'_> {
    type Found = u32;

    #[inline(always)]
    fn append(&mut self, query: [f32; 3], found: &mut Vec<u32>) {
        let Some(squared_radius) = squared_radius(query, self.radius_m) else { return };
        self.stack.clear();
        self.stack.push(0);
        while let Some(entry) = self.stack.pop() {
            if entry & ALL != 0 {
                let start = (entry & !ALL) >> 32;
                let end = entry & 0xffff_ffff;
                found.extend_from_slice(&self.index.order()[start as usize..end as usize]);
                continue;
            }
            match Child::from_number(entry as u32) {
                Child::Block(block) => {
                    let block = &self.index.tree.blocks[block];
                    let squared = block.squared_distances(query);
                    let mut inside = [0; BLOCK];
                    let mut n_inside = 0;
                    // Branch-free: each point is written, and the next one overwrites it if it is outside.
                    for (squared, point) in squared.iter().zip(self.index.slots(block.start)) {
                        inside[n_inside.min(BLOCK - 1)] = *point;
                        n_inside += usize::from(*squared <= squared_radius);
                    }
                    found.extend_from_slice(&inside[..n_inside]);
                }
                Child::Node(node) => {
                    let node = &self.index.tree.nodes[node];
                    let nearest = node.squared_distances(query);
                    let farthest = node.squared_reaches(query);
                    // From the last to the first, so that the first is visited first.
                    for slot in (0..WIDTH).rev() {
                        if nearest[slot] <= squared_radius {
                            let [start, end] = node.points[slot];
                            let all = ALL | u64::from(start) << 32 | u64::from(end);
                            self.stack.push(if farthest[slot] <= squared_radius {
                                all
                            } else {
                                u64::from(node.child[slot])
                            });
                        }
                    }
                }
            }
        }
    }
}
