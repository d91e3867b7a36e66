//! Disjoint sets (union-find) of pixels or runs.

use crate::labels::Labels;
use ndarray::Array2;

/// Every set is represented by its first member in raster order, independent of the order of unions.
pub(crate) struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    pub(crate) fn new(n: usize) -> Self {
        Self { parents: (0..n as u32).collect() }
    }

    /// First member of the set. Halves the path.
    #[inline]
    pub(crate) fn find(&mut self, member: usize) -> usize {
        let mut at = member;
        loop {
            let parent = self.parents[at];
            if parent as usize == at {
                return at;
            }
            let grandparent = self.parents[parent as usize];
            self.parents[at] = grandparent;
            at = grandparent as usize;
        }
    }

    /// A member of the same set, in most cases the first.
    #[inline(always)]
    pub(crate) fn parent(&self, member: u32) -> u32 {
        self.parents[member as usize]
    }

    /// Adds a member in its own set.
    pub(crate) fn add(&mut self) -> u32 {
        let member = self.parents.len() as u32;
        self.parents.push(member);
        member
    }

    /// Joins two sets. Returns the first member of the union.
    #[inline]
    pub(crate) fn union(&mut self, a: usize, b: usize) -> usize {
        let a = self.find(a);
        let b = self.find(b);
        let first = a.min(b);
        let second = a.max(b);
        self.parents[second] = first as u32;
        first
    }

    /// Number of the set of each member, from 1 in the order of first members, and the number of sets.
    pub(crate) fn into_numbers(mut self) -> (Vec<u32>, usize) {
        let mut n = 0;
        for member in 0..self.parents.len() {
            // Parents precede their members, so they have a number already.
            let parent = self.parents[member] as usize;
            self.parents[member] = if parent == member {
                n += 1;
                n
            } else {
                self.parents[parent]
            };
        }
        (self.parents, n as usize)
    }

    /// Labels the sets of the pixels that are `inside`, in raster order.
    pub(crate) fn into_labels(mut self, shape: (usize, usize), inside: impl Fn(usize) -> bool) -> Labels {
        let mut image = Array2::<u32>::zeros(shape);
        let mut areas: Vec<usize> = Vec::new();
        let labels = image.as_slice_mut().expect("a new array is in standard layout");
        for pixel in 0..labels.len() {
            if !inside(pixel) {
                continue;
            }
            let first = self.find(pixel);
            if first == pixel {
                areas.push(0);
                labels[pixel] = areas.len() as u32;
            }
            let label = labels[first];
            labels[pixel] = label;
            areas[label as usize - 1] += 1;
        }
        Labels { image, areas }
    }
}
