//! Rectangles of many rows: along the rows first; then the extremum of two running extrema, one that starts anew at every `k`-th
//! row and runs down and one that runs up: three comparisons whatever the height `k` is (van Herk 1992; Gil and Werman 1993), here
//! of whole rows.

use crate::Level;
use crate::picks::{Pick, pick_into, pick_rows};
use crate::rows::Source;
use crate::sliding::Sliding;

/// Rows come in blocks of the rectangle's height, the first one begins `row_radius` rows above the image: a window is the end of
/// one block and the beginning of the next.
pub(crate) struct High<T> {
    pub(crate) row_radius: usize,
    rows: usize,
    n_taken: usize,
    along: Sliding<T>,
    neutral: T,
    /// Rows of this block so far.
    block: Vec<T>,
    n: usize,
    /// Extremum of this block's rows.
    from_begin: Vec<T>,
    /// Of each row of the block before, the extremum from it to the block's end.
    to_end: Vec<T>,
}

impl<T: Level> High<T> {
    pub(crate) fn new(row_radius: usize, reach: usize, (rows, cols): (usize, usize), neutral: T) -> Self {
        let block = vec![neutral; (2 * row_radius + 1) * cols];
        Self {
            row_radius,
            rows,
            n_taken: 0,
            along: Sliding::new(cols, reach, neutral),
            neutral,
            to_end: block.clone(),
            block,
            n: row_radius,
            from_begin: vec![neutral; cols],
        }
    }

    #[inline(always)]
    pub(crate) fn pair(&mut self, first: usize, source: Source<'_, T>, into: [&mut [T]; 2], pick: impl Pick<T>) {
        for (row, into) in (first..).zip(into) {
            while self.n_taken <= row + self.row_radius {
                self.take(source, into, pick);
            }
        }
    }

    /// Takes a row, or one below the image; `into` is then the extremum of the last `2 row_radius + 1`.
    #[inline(always)]
    fn take(&mut self, source: Source<'_, T>, into: &mut [T], pick: impl Pick<T>) {
        let cols = into.len();
        let line = &mut self.block[self.n * cols..(self.n + 1) * cols];
        if self.n_taken < self.rows {
            self.along.row_mut().copy_from_slice(source.row(self.n_taken));
            self.along.extrema(line, pick);
        } else {
            line.fill(self.neutral);
        }
        self.n_taken += 1;
        pick_into(&mut self.from_begin, line, pick);
        self.n += 1;
        if self.n * cols < self.block.len() {
            pick_rows(into, [&self.to_end[self.n * cols..], &self.from_begin], pick);
            return;
        }
        into.copy_from_slice(&self.from_begin);
        self.n = 0;
        self.from_begin.fill(self.neutral);
        std::mem::swap(&mut self.block, &mut self.to_end);
        for end in (cols..self.to_end.len()).step_by(cols).rev() {
            let (before, after) = self.to_end.split_at_mut(end);
            pick_into(&mut before[end - cols..], &after[..cols], pick);
        }
    }
}
