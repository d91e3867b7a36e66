//! Connected components of a binary image, by runs: stretches of a row that are `true`.

use crate::Connectivity;
use crate::union_find::DisjointSets;
use ndarray::Array2;

/// A partition of some pixels into components.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Labels {
    /// Label of each pixel: 1, 2 … in raster order of the components' first pixels, 0 for none.
    pub image: Array2<u32>,
    /// Pixels of label `i + 1`.
    pub areas: Vec<usize>,
}

impl Labels {
    /// Number of components.
    pub fn n(&self) -> usize {
        self.areas.len()
    }
    /// Area of a label in pixels, 0 for label 0 and past the last.
    pub fn area(&self, label: u32) -> usize {
        (label as usize).checked_sub(1).and_then(|idx| self.areas.get(idx)).copied().unwrap_or(0)
    }
}

/// Components of the pixels that are `true`.
pub fn connected_components(mask: &Array2<bool>, connectivity: Connectivity) -> Labels {
    let runs = Runs::of(mask);
    let (labels, n) = runs.labels(connectivity);
    let (rows, cols) = mask.dim();
    let mut areas = vec![0; n];
    let mut pixels: Vec<u32> = Vec::with_capacity(rows * cols);
    let mut line = vec![0; cols + BURST];
    for row in 0..rows {
        let mut at = 0;
        for run_idx in runs.of_row(row) {
            let ([start, end], label) = (runs.ends[run_idx].map(|col| col as usize), labels[run_idx]);
            paint(&mut line, at, start, 0);
            paint(&mut line, start, end, label);
            areas[label as usize - 1] += end - start;
            at = end;
        }
        paint(&mut line, at, cols, 0);
        pixels.extend_from_slice(&line[..cols]);
    }
    Labels { image: Array2::from_shape_vec((rows, cols), pixels).expect("one label for every pixel"), areas }
}

/// Pixels that are written at once.
const BURST: usize = 8;

/// Writes columns `start..end`, and perhaps some after them, which the next call writes over: most runs are short, and a loop
/// that stops at a column that cannot be foreseen costs more than a few pixels too many.
#[inline(always)]
fn paint(line: &mut [u32], start: usize, end: usize, label: u32) {
    for at in (start..end).step_by(BURST) {
        line[at..at + BURST].copy_from_slice(&[label; BURST]);
    }
}

/// All runs of an image in raster order.
pub(crate) struct Runs {
    /// First column, and the one after the last.
    pub(crate) ends: Vec<[u32; 2]>,
    /// Index of each row's first run, and the number of runs.
    row_starts: Vec<u32>,
}

/// Bits of a word.
const WORD: usize = 64;

impl Runs {
    pub(crate) fn of(mask: &Array2<bool>) -> Self {
        let standard = mask.as_standard_layout();
        let mut runs = Self { ends: Vec::new(), row_starts: vec![0] };
        wide_loops::run(
            #[inline(always)]
            || {
                for row in standard.rows() {
                    runs.add_row(row.as_slice().expect("rows of the standard layout are contiguous"));
                }
            },
        );
        runs
    }

    #[inline(always)]
    fn add_row(&mut self, row: &[bool]) {
        // The last pixel of the word before, as bit 0.
        let mut before = 0;
        let mut start = 0;
        for (word_idx, pixels) in row.chunks(WORD).enumerate() {
            let word = word_of(pixels);
            // A bit for each pixel that differs from the one before it: where a run begins or has ended.
            let mut changes = word ^ (word << 1 | before);
            while changes != 0 {
                let bit = changes.trailing_zeros();
                let col = (word_idx * WORD) as u32 + bit;
                if word >> bit & 1 == 1 {
                    start = col;
                } else {
                    self.ends.push([start, col]);
                }
                changes &= changes - 1;
            }
            before = word >> (WORD - 1);
        }
        // A row that does not fill its last word ends with zeros.
        if before == 1 {
            self.ends.push([start, row.len() as u32]);
        }
        self.row_starts.push(self.ends.len() as u32);
    }

    pub(crate) fn of_row(&self, row: usize) -> std::ops::Range<usize> {
        self.row_starts[row] as usize..self.row_starts[row + 1] as usize
    }

    /// Label of each run, and how many labels.
    pub(crate) fn labels(&self, connectivity: Connectivity) -> (Vec<u32>, usize) {
        let reach = u32::from(connectivity == Connectivity::Eight);
        let mut sets = DisjointSets::new(self.ends.len());
        for row in 1..self.row_starts.len().saturating_sub(1) {
            let (above, below) = (self.of_row(row - 1), self.of_row(row));
            let (mut upper, mut lower) = (above.start, below.start);
            // Name of the lower run's set: known already, so that only the upper one's is looked for.
            let mut first = lower;
            while upper < above.end && lower < below.end {
                let ([u_start, u_end], [l_start, l_end]) = (self.ends[upper], self.ends[lower]);
                if u_start < l_end + reach && l_start < u_end + reach {
                    first = sets.union_firsts(first, upper);
                }
                // Whichever ends first meets no other run.
                let upper_ends_first = usize::from(u_end < l_end);
                upper += upper_ends_first;
                lower += 1 - upper_ends_first;
                first = if upper_ends_first == 1 { first } else { lower };
            }
        }
        let mut labels = vec![0; self.ends.len()];
        let mut n = 0;
        for run_idx in 0..labels.len() {
            let first = sets.find(run_idx);
            if first == run_idx {
                n += 1;
                labels[run_idx] = n;
            } else {
                labels[run_idx] = labels[first];
            }
        }
        (labels, n as usize)
    }
}

/// A bit for each of up to 64 pixels, the first lowest.
#[inline(always)]
fn word_of(pixels: &[bool]) -> u64 {
    let mut word = 0;
    let (eights, rest) = pixels.as_chunks::<8>();
    for (i, eight) in eights.iter().enumerate() {
        // Moves the lowest bits of eight bytes into the highest byte.
        let bits = u64::from_le_bytes(eight.map(u8::from)).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        word |= bits << (8 * i);
    }
    for (i, &pixel) in rest.iter().enumerate() {
        word |= u64::from(pixel) << (8 * eights.len() + i);
    }
    word
}
