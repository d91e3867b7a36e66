//! Sliding extremum along a row. The extremum over `k` pixels combines two extrema over `k/2` pixels, so `log2 k` vectorized passes over a
//! row in the cache are enough for any width.

use crate::level::Level;
use crate::picks::{Pick, pick_rows};

/// A row with neutral pixels at both ends, and its sliding extremum.
pub(crate) struct Sliding<T> {
    reach: usize,
    padded: Vec<T>,
    /// Extrema over 2, 4 … pixels, and a buffer for the next.
    doubled: [Vec<T>; 2],
}

impl<T: Level> Sliding<T> {
    /// A window of `reach` pixels to both sides.
    pub(crate) fn new(cols: usize, reach: usize, neutral: T) -> Self {
        let padded = vec![neutral; cols + 2 * reach];
        let doubled = if reach > 2 { [padded.clone(), padded.clone()] } else { [Vec::new(), Vec::new()] };
        Self { reach, padded, doubled }
    }

    /// The pixels of the row.
    #[inline(always)]
    pub(crate) fn row_mut(&mut self) -> &mut [T] {
        let end = self.padded.len() - self.reach;
        &mut self.padded[self.reach..end]
    }

    #[inline(always)]
    pub(crate) fn extrema(&mut self, into: &mut [T], pick: impl Pick<T>) {
        let n = into.len();
        let width = 2 * self.reach + 1;
        let shifted = |by: usize| &self.padded[by..by + n];
        match width {
            1 => return into.copy_from_slice(shifted(0)),
            3 => return pick_rows(into, [0, 1, 2].map(shifted), pick),
            5 => return pick_rows(into, [0, 1, 2, 3, 4].map(shifted), pick),
            _ => {}
        }
        let [doubled, spare] = &mut self.doubled;
        let mut over = 1;
        while 2 * over < width {
            let len = self.padded.len() + 1 - 2 * over;
            let source = if over == 1 { &self.padded } else { &*doubled };
            pick_rows(&mut spare[..len], [&source[..len], &source[over..]], pick);
            std::mem::swap(spare, doubled);
            over *= 2;
        }
        // The two halves may overlap, which does not change the extremum.
        pick_rows(into, [&doubled[..n], &doubled[width - over..]], pick);
    }
}
