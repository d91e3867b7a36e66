//! Disjoint sets of pixels.

use crate::Labels;
use ndarray::Array2;

/// Every set is named by its first member in raster order, whatever the order of the unions.
pub(crate) struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    pub(crate) fn new(n: usize) -> Self {
        Self { parents: (0..n as u32).collect() }
    }

    /// The set's first member. Halves the path on the way.
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

    #[inline]
    pub(crate) fn union(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        let (first, second) = (a.min(b), a.max(b));
        self.parents[second] = first as u32;
    }

    /// The union of the set of that first member and the set of any member; its first member.
    #[inline]
    pub(crate) fn union_firsts(&mut self, first: usize, member: usize) -> usize {
        let other = self.find(member);
        let (before, after) = (first.min(other), first.max(other));
        self.parents[after] = before as u32;
        before
    }

    /// Numbers the sets of the pixels that are `inside`, in raster order.
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
