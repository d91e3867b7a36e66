//! The extremum over an element, row by row: rows of the image go in, rows of the result come out as soon as they can.
//!
//! Along a row, the extremum over `k` pixels is that over `k/2` of itself and of its shift, so `log2 k` passes over a row that
//! lies in the cache do for any width, each of them over as many pixels at once as a register holds. Down the columns, high
//! rectangles take the extremum of two running extrema, one that starts anew at every `k`-th row and runs down and one that
//! runs up: three comparisons whatever `k` is (van Herk 1992; Gil and Werman 1993), here of whole rows. Low rectangles and
//! other elements take one comparison for each of their runs.

use crate::Level;
use crate::blocks::{block, block_mut, in_blocks};
use crate::element::{Run, Shape};

/// Radius from which van Herk's three comparisons with their buffers cost less than one for each row.
const HIGH_RADIUS: usize = 5;

/// The greater or the lesser of two.
pub(crate) trait Pick<T>: Fn(T, T) -> T + Copy {}
impl<T, F: Fn(T, T) -> T + Copy> Pick<T> for F {}

/// One dilation or erosion under way.
pub(crate) enum Rows<T> {
    High(High<T>),
    Any(Gather<T>),
}

impl<T: Level> Rows<T> {
    pub(crate) fn new(shape: &Shape, (rows, cols): (usize, usize), neutral: T) -> Self {
        match shape {
            Shape::Rectangle { row_radius, col_radius } => {
                // A window that reaches past both ends sees the whole line already.
                let (row_radius, reach) = ((*row_radius).min(rows), (*col_radius).min(cols) as isize);
                if row_radius >= HIGH_RADIUS {
                    return Self::High(High::new(row_radius, reach, cols, neutral));
                }
                let radius = row_radius as isize;
                let runs: Vec<Run> = (-radius..=radius).map(|row| Run { row, first: -reach, last: reach }).collect();
                Self::Any(Gather::new(&runs, (rows, cols), neutral))
            }
            Shape::Runs(runs) => Self::Any(Gather::new(runs, (rows, cols), neutral)),
        }
    }
    #[inline(always)]
    pub(crate) fn push(&mut self, row: &[T], result: &mut Vec<T>, pick: impl Pick<T>) {
        match self {
            Self::High(high) => high.push(Some(row), result, pick),
            Self::Any(gather) => gather.push(row, result, pick),
        }
    }
    /// The rows that waited for rows below the last.
    #[inline(always)]
    pub(crate) fn finish(&mut self, result: &mut Vec<T>, pick: impl Pick<T>) {
        match self {
            Self::High(high) => (0..high.row_radius).for_each(|_| high.push(None, result, pick)),
            Self::Any(gather) => gather.flush(gather.rows, result, pick),
        }
    }
}

/// High rectangles. Rows come in blocks of the rectangle's height, the first one begins `row_radius` rows above the image: a
/// window is the end of one block and the beginning of the next.
pub(crate) struct High<T> {
    row_radius: usize,
    window: Window,
    scratch: Doubling<T>,
    neutral: T,
    /// Rows of this block so far.
    block: Vec<T>,
    n: usize,
    /// Extremum of this block's rows.
    from_begin: Vec<T>,
    /// Of each row of the block before, the extremum from it to the block's end; empty in the first block.
    to_end: Vec<T>,
    line: Vec<T>,
}

impl<T: Level> High<T> {
    fn new(row_radius: usize, reach: isize, cols: usize, neutral: T) -> Self {
        let scratch = Doubling::new(cols, -reach, reach, neutral);
        let block = vec![neutral; (2 * row_radius + 1) * cols];
        Self {
            row_radius,
            window: Window::new(&scratch, -reach, reach),
            scratch,
            neutral,
            block,
            n: row_radius,
            from_begin: vec![neutral; cols],
            to_end: Vec::new(),
            line: vec![neutral; cols],
        }
    }

    /// Takes a row, or one below the image.
    #[inline(always)]
    fn push(&mut self, row: Option<&[T]>, result: &mut Vec<T>, pick: impl Pick<T>) {
        let cols = self.from_begin.len();
        let into = &mut self.block[self.n * cols..(self.n + 1) * cols];
        match row {
            Some(row) => {
                self.scratch.load(row);
                self.scratch.slide(self.window, into, pick);
            }
            None => into.fill(self.neutral),
        }
        pick_into(&mut self.from_begin, into, pick);
        self.n += 1;
        let is_full = self.n * cols == self.block.len();
        if is_full {
            result.extend_from_slice(&self.from_begin);
        } else if !self.to_end.is_empty() {
            let ends = &self.to_end[self.n * cols..(self.n + 1) * cols];
            pick_rows(&mut self.line, [ends, &self.from_begin], pick);
            // Extending by an iterator would leave this function, and the wide registers with it.
            result.extend_from_slice(&self.line);
        }
        if is_full {
            self.n = 0;
            self.from_begin.fill(self.neutral);
            self.to_end.resize(self.block.len(), self.neutral);
            std::mem::swap(&mut self.block, &mut self.to_end);
            for end in (cols..self.to_end.len()).step_by(cols).rev() {
                let (before, after) = self.to_end.split_at_mut(end);
                pick_into(&mut before[end - cols..], &after[..cols], pick);
            }
        }
    }
}

/// Any element, run by run.
pub(crate) struct Gather<T> {
    rows: usize,
    cols: usize,
    neutral: T,
    scratch: Doubling<T>,
    /// Of the rows from `n_pushed - span` on, the extrema over each width, padded as the row in `scratch` is.
    kept: Vec<Width<T>>,
    runs: Vec<(Run, usize)>,
    span: usize,
    last_row: isize,
    n_pushed: usize,
    n_done: usize,
    line: Vec<T>,
}

/// The extrema over one width, for `span` rows in turn.
struct Width<T> {
    width: usize,
    rows: Vec<T>,
}

impl<T: Level> Gather<T> {
    fn new(runs: &[Run], (rows, cols): (usize, usize), neutral: T) -> Self {
        let (n_rows, n_cols) = (rows as isize, cols as isize);
        // A run that no pixel of the image sees is none; one that reaches past both ends sees the whole line.
        let is_seen = |run: &&Run| run.row.abs() < n_rows && run.first < n_cols && run.last > -n_cols;
        let clipped = |run: &Run| Run { row: run.row, first: run.first.max(-n_cols), last: run.last.min(n_cols) };
        let runs: Vec<Run> = runs.iter().filter(is_seen).map(clipped).collect();
        let reach = |side: fn(&Run) -> isize| runs.iter().map(side);
        let (first, last) = (reach(|r| r.first).min().unwrap_or(0), reach(|r| r.last).max().unwrap_or(0));
        let (first_row, last_row) = (reach(|r| r.row).min().unwrap_or(0), reach(|r| r.row).max().unwrap_or(0));
        let span = (last_row - first_row + 1) as usize;
        let scratch = Doubling::new(cols, first, last, neutral);
        let width = |run: &Run| (run.last - run.first + 1) as usize;
        let mut widths: Vec<usize> = runs.iter().map(width).collect();
        widths.sort_unstable();
        widths.dedup();
        let place = |run: &Run| widths.binary_search(&width(run)).expect("is among the widths");
        Self {
            rows,
            cols,
            neutral,
            runs: runs.iter().map(|run| (*run, place(run))).collect(),
            kept: widths
                .iter()
                .map(|&width| Width { width, rows: vec![neutral; span * scratch.padded.len()] })
                .collect(),
            scratch,
            span,
            last_row,
            n_pushed: 0,
            n_done: 0,
            line: vec![neutral; cols],
        }
    }

    #[inline(always)]
    fn push(&mut self, row: &[T], result: &mut Vec<T>, pick: impl Pick<T>) {
        let padded_len = self.scratch.padded.len();
        let slot = (self.n_pushed % self.span) * padded_len;
        self.scratch.load(row);
        for Width { width, rows } in &mut self.kept {
            let whole = Window { begin: 0, width: *width };
            self.scratch.slide(whole, &mut rows[slot..=slot + padded_len - *width], pick);
        }
        self.n_pushed += 1;
        let ready = (self.n_pushed as isize - self.last_row).clamp(0, self.rows as isize);
        self.flush(ready as usize, result, pick);
    }

    /// Rows of the result up to `end`.
    #[inline(always)]
    fn flush(&mut self, end: usize, result: &mut Vec<T>, pick: impl Pick<T>) {
        let padded_len = self.scratch.padded.len();
        for target in self.n_done..end {
            let (kept, n) = (&self.kept, self.cols);
            let sources = self.runs.iter().filter_map(|(run, place)| {
                let row = target.checked_add_signed(run.row).filter(|&row| row < self.n_pushed)?;
                let begin = (row % self.span) * padded_len + self.scratch.lead.wrapping_add_signed(run.first);
                Some(&kept[*place].rows[begin..begin + n])
            });
            let sources: Vec<&[T]> = sources.collect();
            if let [only] = *sources.as_slice() {
                result.extend_from_slice(only);
                continue;
            }
            pick_all(&mut self.line, &sources, self.neutral, pick);
            result.extend_from_slice(&self.line);
        }
        self.n_done = self.n_done.max(end);
    }
}

/// The extremum of all rows. Several at once, so that what is between is read and written less often; of an extremum of too
/// few, the first is taken once more.
#[inline(always)]
fn pick_all<T: Level>(into: &mut [T], rows: &[&[T]], neutral: T, pick: impl Pick<T>) {
    let row = |idx: usize| *rows.get(idx).unwrap_or(&rows[0]);
    match rows.len() {
        0 => into.fill(neutral),
        1..=3 => pick_rows(into, [0, 1, 2].map(row), pick),
        _ => pick_rows(into, [0, 1, 2, 3, 4].map(row), pick),
    }
    for idx in (5..rows.len()).step_by(4) {
        let rows = [idx, idx + 1, idx + 2, idx + 3].map(row);
        in_blocks!(into.len(), pick_more_in_block(into, &rows, pick));
    }
}

/// The extremum of `N` rows, pixel by pixel.
#[inline(always)]
fn pick_rows<T: Level, const N: usize>(into: &mut [T], rows: [&[T]; N], pick: impl Pick<T>) {
    in_blocks!(into.len(), pick_in_block(into, &rows, pick));
}

#[inline(always)]
fn pick_in_block<T: Level, const N: usize>(start: usize, into: &mut [T], rows: &[&[T]], pick: impl Pick<T>) {
    let mut values: [T; N] = *block(rows[0], start);
    for row in &rows[1..] {
        pick_values(&mut values, block(row, start), pick);
    }
    *block_mut(into, start) = values;
}

/// The extremum of the rows and of what is there.
#[inline(always)]
fn pick_more_in_block<T: Level, const N: usize>(start: usize, into: &mut [T], rows: &[&[T]], pick: impl Pick<T>) {
    let mut values: [T; N] = *block(into, start);
    for row in rows {
        pick_values(&mut values, block(row, start), pick);
    }
    *block_mut(into, start) = values;
}

#[inline(always)]
fn pick_values<T: Level, const N: usize>(values: &mut [T; N], others: &[T; N], pick: impl Pick<T>) {
    for i in 0..N {
        values[i] = pick(values[i], others[i]);
    }
}

/// `into = pick(into, other)`, pixel by pixel.
#[inline(always)]
fn pick_into<T: Level>(into: &mut [T], other: &[T], pick: impl Pick<T>) {
    in_blocks!(into.len(), pick_more_in_block(into, &[other], pick));
}

/// `width` pixels from `begin + i` on, in a padded row.
#[derive(Clone, Copy)]
struct Window {
    begin: usize,
    width: usize,
}

impl Window {
    /// Columns `first..=last` beside a pixel.
    fn new<T>(scratch: &Doubling<T>, first: isize, last: isize) -> Self {
        Self { begin: scratch.lead.wrapping_add_signed(first), width: (last - first + 1) as usize }
    }
}

/// A row with neutral pixels at both ends, and its extrema over 1, 2, 4 … pixels.
struct Doubling<T> {
    /// Neutral pixels before the row.
    lead: usize,
    padded: Vec<T>,
    /// Extrema over `reach` pixels, if `reach` is above 1.
    doubled: Vec<T>,
    reach: usize,
    spare: Vec<T>,
}

impl<T: Level> Doubling<T> {
    fn new(cols: usize, first: isize, last: isize, neutral: T) -> Self {
        let (lead, trail) = ((-first).max(0) as usize, last.max(0) as usize);
        let padded = vec![neutral; lead + cols + trail];
        Self { lead, doubled: padded.clone(), spare: padded.clone(), padded, reach: 1 }
    }

    #[inline(always)]
    fn load(&mut self, row: &[T]) {
        self.padded[self.lead..self.lead + row.len()].copy_from_slice(row);
        self.reach = 1;
    }

    /// The window's extremum for `into.len()` pixels. Between two loads, widths must not fall.
    #[inline(always)]
    fn slide(&mut self, window: Window, into: &mut [T], pick: impl Pick<T>) {
        let n = into.len();
        let Window { begin, width } = window;
        let shifted = |by: usize| &self.padded[begin + by..begin + by + n];
        match width {
            1 => return into.copy_from_slice(shifted(0)),
            2 | 3 => return pick_rows(into, [0, 1, width - 1].map(shifted), pick),
            4 | 5 => return pick_rows(into, [0, 1, 2, 3, width - 1].map(shifted), pick),
            _ => {}
        }
        while 2 * self.reach < width {
            let len = self.padded.len() + 1 - 2 * self.reach;
            let source = if self.reach == 1 { &self.padded } else { &self.doubled };
            pick_rows(&mut self.spare[..len], [&source[..len], &source[self.reach..]], pick);
            std::mem::swap(&mut self.spare, &mut self.doubled);
            self.reach *= 2;
        }
        let source = if self.reach == 1 { &self.padded } else { &self.doubled };
        // The two halves may overlap; an extremum does not mind.
        let second = begin + width - self.reach;
        pick_rows(into, [&source[begin..begin + n], &source[second..second + n]], pick);
    }
}
