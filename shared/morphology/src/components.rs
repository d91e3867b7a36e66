//! Connected components of a binary image, by runs: stretches of a row that are `true`.

use crate::Connectivity;
use crate::blocks::{block, block_mut, in_blocks, wide};
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
    let mut areas = vec![0; n];
    let mut pixels: Vec<u32> = Vec::with_capacity(mask.len());
    let mut line = vec![0; mask.ncols() + BURST];
    for (row, inside) in mask.as_standard_layout().rows().into_iter().enumerate() {
        let inside = inside.to_slice().expect("rows of the standard layout are contiguous");
        let of_row = runs.of_row(row);
        let runs = runs.ends[of_row.clone()].iter().zip(&labels[of_row]);
        wide!({
            for (&[start, end], &label) in runs {
                paint(&mut line, start as usize, end as usize, label);
                areas[label as usize - 1] += (end - start) as usize;
            }
            let n = inside.len();
            in_blocks!(n, clear_in_block(&mut line, inside));
        });
        pixels.extend_from_slice(&line[..inside.len()]);
    }
    Labels { image: Array2::from_shape_vec(mask.dim(), pixels).expect("one label for every pixel"), areas }
}

/// Pixels that are written at once.
const BURST: usize = 16;

/// Writes columns `start..end`, and perhaps some after them: most runs are short, and a loop that stops at a column that
/// cannot be foreseen costs more than a few pixels too many.
#[inline(always)]
fn paint(line: &mut [u32], start: usize, end: usize, label: u32) {
    let mut at = start;
    while at < end {
        *block_mut(line, at) = [label; BURST];
        at += BURST;
    }
}

/// Pixels that are not inside get label 0.
#[inline(always)]
fn clear_in_block<T: Copy + Default, const N: usize>(start: usize, line: &mut [T], inside: &[bool]) {
    let (labels, inside): (&mut [T; N], &[bool; N]) = (block_mut(line, start), block(inside, start));
    for i in 0..N {
        labels[i] = if inside[i] { labels[i] } else { T::default() };
    }
}

/// All runs of an image in raster order.
pub(crate) struct Runs {
    /// First column, and the one after the last.
    pub(crate) ends: Vec<[u32; 2]>,
    /// Index of each row's first run, and the number of runs.
    row_starts: Vec<u32>,
    /// The pixels as bits, the first lowest, each row in words of its own.
    words: Vec<u64>,
    words_per_row: usize,
}

/// Bits of a word.
const WORD: usize = 64;

impl Runs {
    pub(crate) fn of(mask: &Array2<bool>) -> Self {
        let standard = mask.as_standard_layout();
        let words_per_row = mask.ncols().div_ceil(WORD);
        let words = Vec::with_capacity(mask.nrows() * words_per_row);
        let mut runs = Self { ends: Vec::new(), row_starts: vec![0], words, words_per_row };
        let mut changes = vec![0; mask.ncols() + WORD + 1];
        wide!({
            for row in standard.rows() {
                let row = row.to_slice().expect("rows of the standard layout are contiguous");
                runs.add_row(row, &mut changes);
            }
        });
        runs
    }

    #[inline(always)]
    fn add_row(&mut self, row: &[bool], changes: &mut [u32]) {
        // The last pixel of the word before, as bit 0.
        let mut before = 0;
        let mut n = 0;
        for (word_idx, pixels) in row.chunks(WORD).enumerate() {
            let word = word_of(pixels);
            self.words.push(word);
            // A bit for each pixel that differs from the one before it: where a run begins or has ended.
            n += list(word ^ (word << 1 | before), (word_idx * WORD) as u32, &mut changes[n..]);
            before = word >> (WORD - 1);
        }
        // A row that does not fill its last word ends with zeros.
        if before == 1 {
            changes[n] = row.len() as u32;
            n += 1;
        }
        self.ends.extend_from_slice(changes[..n].as_chunks().0);
        self.row_starts.push(self.ends.len() as u32);
    }

    pub(crate) fn of_row(&self, row: usize) -> std::ops::Range<usize> {
        self.row_starts[row] as usize..self.row_starts[row + 1] as usize
    }

    /// Label of each run, and how many labels.
    pub(crate) fn labels(&self, connectivity: Connectivity) -> (Vec<u32>, usize) {
        // Sets of runs that are known to belong together, in the order of their first runs.
        let mut sets = DisjointSets::new(0);
        let mut labels = vec![NO_SET; self.ends.len()];
        for row in 0..self.row_starts.len() - 1 {
            if row > 0 {
                wide!(self.join_above(row, connectivity, &mut labels, &mut sets));
            }
            for set in labels[self.of_row(row)].iter_mut().filter(|set| **set == NO_SET) {
                *set = sets.add();
            }
        }
        let (numbers, n) = sets.into_numbers();
        for label in &mut labels {
            *label = numbers[*label as usize];
        }
        (labels, n)
    }

    /// Gives the runs of a row the sets of the runs above that they touch. Branches that depend on where runs begin cannot be
    /// foreseen, so contacts are found many pixels at a time, each where its run above and its run below lie side by side first.
    #[inline(always)]
    fn join_above(&self, row: usize, connectivity: Connectivity, sets_of_runs: &mut [u32], sets: &mut DisjointSets) {
        let words_of = |row: usize| &self.words[row * self.words_per_row..(row + 1) * self.words_per_row];
        // Runs that have begun.
        let (mut n_above, mut n_below) = (self.row_starts[row - 1], self.row_starts[row]);
        let (mut above_before, mut below_before) = (0, 0);
        for (&above, &below) in words_of(row - 1).iter().zip(words_of(row)) {
            // The pixels one to the left.
            let (above_left, below_left) = (above << 1 | above_before, below << 1 | below_before);
            let (begins_above, begins_below) = (above & !above_left, below & !below_left);
            let mut contacts = above & below & !(above_left & below_left);
            if connectivity == Connectivity::Eight {
                contacts |= begins_below & above_left & !above | begins_above & below_left & !below;
            }
            while contacts != 0 {
                let up_to_here = contacts ^ (contacts - 1);
                let upper = n_above + (begins_above & up_to_here).count_ones() - 1;
                let lower = n_below + (begins_below & up_to_here).count_ones() - 1;
                let set_above = sets.parent(sets_of_runs[upper as usize]);
                let set = &mut sets_of_runs[lower as usize];
                *set = if *set == NO_SET { set_above } else { *set };
                if *set != set_above {
                    *set = sets.union(*set as usize, set_above as usize) as u32;
                }
                contacts &= contacts - 1;
            }
            n_above += begins_above.count_ones();
            n_below += begins_below.count_ones();
            (above_before, below_before) = (above >> (WORD - 1), below >> (WORD - 1));
        }
    }
}

/// No run above is known yet that a run touches.
const NO_SET: u32 = u32::MAX;

/// Numbers of the bits that are set, counted from `first`, and how many; what comes after them is of no use.
#[inline(always)]
fn list(mut bits: u64, first: u32, into: &mut [u32]) -> usize {
    let n = bits.count_ones() as usize;
    for start in (0..n).step_by(BURST) {
        for place in &mut into[start..start + BURST] {
            *place = first + bits.trailing_zeros();
            bits &= bits.wrapping_sub(1);
        }
    }
    n
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
