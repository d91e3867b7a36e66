//! The extremum over pixels of one row. That over `k` pixels is that over `k/2` of itself and of its shift, so `log2 k` passes over
//! a row that lies in the cache do for any width, each of them over as many pixels at once as a register holds.

use crate::Level;
use crate::picks::{Pick, pick_rows};

/// A row with neutral pixels at both ends, and the extremum over a window that slides along it.
pub(crate) struct Sliding<T> {
    reach: usize,
    padded: Vec<T>,
    /// Extrema over 2, 4 … pixels, and room for the next.
    doubled: [Vec<T>; 2],
}

impl<T: Level> Sliding<T> {
    /// Windows of `reach` pixels to both sides.
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
        let (n, width) = (into.len(), 2 * self.reach + 1);
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
        // The two halves may overlap; an extremum does not mind.
        pick_rows(into, [&doubled[..n], &doubled[width - over..]], pick);
    }
}
