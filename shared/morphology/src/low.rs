//! Rectangles of few rows. Columns are filtered first, for two result rows together because their windows share all rows but one. Then
//! the two rows are filtered.

use crate::level::Level;
use crate::picks::{Pick, pick_pair};
use crate::sliding::Sliding;
use crate::source::Source;

pub(crate) struct Low<T> {
    pub(crate) row_radius: usize,
    rows: usize,
    down: [Sliding<T>; 2],
}

impl<T: Level> Low<T> {
    pub(crate) fn new(row_radius: usize, reach: usize, (rows, cols): (usize, usize), neutral: T) -> Self {
        let down = || Sliding::new(cols, reach, neutral);
        Self { row_radius, rows, down: [down(), down()] }
    }

    #[inline(always)]
    pub(crate) fn pair(&mut self, first: usize, source: Source<'_, T>, into: [&mut [T]; 2], pick: impl Pick<T>) {
        // Rows outside the image are replaced by its first or last row, which does not change the extremum.
        let row = |above_and_down: usize| {
            source.row((first + above_and_down).saturating_sub(self.row_radius).min(self.rows - 1))
        };
        let ends = [row(0), row(2 * self.row_radius + 1)];
        let lines = self.down.each_mut().map(Sliding::row_mut);
        match self.row_radius {
            0 => lines.into_iter().zip(ends).for_each(|(line, end)| line.copy_from_slice(end)),
            1 => pick_pair(lines, ends, [1, 2].map(row), pick),
            2 => pick_pair(lines, ends, [1, 2, 3, 4].map(row), pick),
            _ => pick_pair(lines, ends, [1, 2, 3, 4, 5, 6, 7, 8].map(|i: usize| row(i.min(2 * self.row_radius))), pick),
        }
        for (line, into) in self.down.iter_mut().zip(into) {
            line.extrema(into, pick);
        }
    }
}
