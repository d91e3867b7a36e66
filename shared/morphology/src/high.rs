//! Rectangles of many rows. Rows are filtered first. Columns use the algorithm of van Herk (1992) and Gil and Werman (1993) on whole
//! rows: running extrema restart at every `k`-th row, one downwards and one upwards, so a result needs three comparisons for any height
//! `k`.

use crate::level::Level;
use crate::picks::{Pick, pick_into, pick_rows};
use crate::sliding::Sliding;
use crate::source::Source;

/// Rows are processed in blocks of the height of the rectangle. The first block begins `row_radius` rows above the image. A window
/// consists of the end of one block and the beginning of the next.
pub(crate) struct High<T> {
    pub(crate) row_radius: usize,
    rows: usize,
    n_taken: usize,
    along: Sliding<T>,
    neutral: T,
    /// Rows of the current block.
    block: Vec<T>,
    n: usize,
    /// Extremum of the rows of the current block so far.
    from_begin: Vec<T>,
    /// For each row of the previous block, the extremum from this row to the end of the block.
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

    /// Adds a row, or a neutral row below the image. Writes the extremum of the last `2 row_radius + 1` rows to `into`.
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
