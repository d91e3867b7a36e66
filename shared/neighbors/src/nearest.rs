//! k nearest neighbors.

use crate::batch::Search;
use crate::candidates::{Candidates, Heap, LONGEST_LIST, SortedList, key, neighbor};
use crate::index::{Neighbor, SpatialIndex};
use crate::position::is_valid;
use crate::tree::Child;

impl SpatialIndex {
    /// The k nearest points, nearest first.
    pub fn nearest(&self, query: [f32; 3], k: usize) -> Vec<Neighbor> {
        let mut found = Vec::new();
        let mut search = NearestSearch::new(self, k);
        wide_loops::run(
            #[inline(always)]
            || search.append(query, &mut found),
        );
        found
    }
}

/// Memory of searches for k points, reused by each query.
pub(crate) struct NearestSearch<'a> {
    index: &'a SpatialIndex,
    k: usize,
    list: SortedList,
    heap: Heap,
    /// Children to visit: the bits of the squared distance above the child's number; the nearest is last.
    stack: Vec<u64>,
}

impl<'a> NearestSearch<'a> {
    pub fn new(index: &'a SpatialIndex, k: usize) -> Self {
        let k = k.min(index.len());
        let (of_list, of_heap) = if k <= LONGEST_LIST { (k.max(1), 0) } else { (1, k) };
        Self { index, k, list: SortedList::new(of_list), heap: Heap::new(of_heap), stack: Vec::with_capacity(64) }
    }
}

impl Search for NearestSearch<'_> {
    type Found = Neighbor;

    /// Appends the neighbors, nearest first.
    #[inline(always)]
    fn append(&mut self, query: [f32; 3], found: &mut Vec<Neighbor>) {
        if self.k == 0 || !is_valid(query) {
            return;
        }
        if self.k <= LONGEST_LIST {
            self.list.clear();
            search(self.index, query, &mut self.list, &mut self.stack);
            found.extend(self.list.keys().iter().map(|key| neighbor(*key)));
        } else {
            search(self.index, query, &mut self.heap, &mut self.stack);
            found.extend(self.heap.take().into_iter().map(neighbor));
        }
    }
}

#[inline(always)]
fn search(index: &SpatialIndex, query: [f32; 3], candidates: &mut impl Candidates, stack: &mut Vec<u64>) {
    stack.clear();
    stack.push(0);
    while let Some(next) = stack.pop() {
        // A child at the distance of the limit may have a point with a smaller number.
        if next >> 32 > candidates.limit() >> 32 {
            continue;
        }
        match Child::from_number(next as u32) {
            Child::Block(block) => {
                let block = &index.tree.blocks[block];
                let squared = block.squared_distances(query);
                let points = index.slots(block.start);
                for (squared, point) in squared.iter().zip(points) {
                    let key = key(*squared, *point);
                    if key < candidates.limit() {
                        candidates.add(key);
                    }
                }
            }
            Child::Node(node) => {
                let node = &index.tree.nodes[node];
                let limit = candidates.limit() >> 32;
                let first = stack.len();
                for (squared, child) in node.squared_distances(query).iter().zip(&node.child) {
                    let key = key(*squared, *child);
                    // Unused slots are infinitely far away.
                    if key >> 32 <= limit && *squared < f32::INFINITY {
                        let mut slot = stack.len();
                        stack.push(key);
                        while slot > first && stack[slot - 1] < key {
                            stack[slot] = stack[slot - 1];
                            slot -= 1;
                        }
                        stack[slot] = key;
                    }
                }
            }
        }
    }
}
