//! Cells that an object covers over a submap, and at its ends.

use serde::{Deserialize, Serialize};

/// Cells of an object. Comparing the cells at its ends shows whether it moves.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Footprint<C> {
    /// All cells.
    pub all: Vec<C>,
    /// Cells of its first half second.
    pub at_first: Vec<C>,
    /// Cells of its last half second.
    pub at_last: Vec<C>,
}

impl<C> Default for Footprint<C> {
    fn default() -> Self {
        Self { all: Vec::new(), at_first: Vec::new(), at_last: Vec::new() }
    }
}

impl<C: Ord> Footprint<C> {
    /// Sorts the cells and removes duplicates.
    pub(crate) fn sort(&mut self) {
        for cells in [&mut self.all, &mut self.at_first, &mut self.at_last] {
            cells.sort_unstable();
            cells.dedup();
        }
    }

    /// Appends another footprint. Call [`Footprint::sort`] afterwards.
    pub(crate) fn append(&mut self, mut other: Self) {
        self.all.append(&mut other.all);
        self.at_first.append(&mut other.at_first);
        self.at_last.append(&mut other.at_last);
    }

    /// Converts the sorted footprint to other cells.
    pub(crate) fn mapped<D: Ord>(&self, cell: impl Fn(&C) -> D) -> Footprint<D> {
        let [all, at_first, at_last] =
            [&self.all, &self.at_first, &self.at_last].map(|cells| cells.iter().map(&cell).collect());
        let mut footprint = Footprint { all, at_first, at_last };
        footprint.sort();
        footprint
    }

    /// Overlap of the first and the last cells as a fraction of the smaller set.
    pub(crate) fn overlap_of_ends(&self) -> f64 {
        overlap(&self.at_first, &self.at_last)
    }
}

/// Overlap of two sorted sets as a fraction of the smaller one; 0 if one is empty.
pub(crate) fn overlap<T: Ord>(a: &[T], b: &[T]) -> f64 {
    let (small, large) = if a.len() <= b.len() { (a, b) } else { (b, a) };
    let n_both = small.iter().filter(|member| large.binary_search(member).is_ok()).count();
    n_both as f64 / small.len().max(1) as f64
}
