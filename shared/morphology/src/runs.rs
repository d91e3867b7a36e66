//! Connected components of runs. A run is a connected part of a row; runs that touch in consecutive rows belong to one component.
//! Branches that depend on the start of runs are unpredictable, so pixels are reduced to bits, and runs are found and
//! joined one word of bits at a time.

use crate::neighbors::Connectivity;
use crate::union_find::DisjointSets;

/// All runs of an image in raster order, with the labels of their components.
#[derive(Default)]
pub(crate) struct Runs {
    /// First column, and the column after the last.
    pub(crate) ends: Vec<[u32; 2]>,
    /// Label of each run.
    pub(crate) labels: Vec<u32>,
    pub(crate) n_labels: usize,
    /// Index of the first run of each row, then the number of runs.
    row_starts: Vec<u32>,
}

impl Runs {
    /// Indices of the runs of a row.
    pub(crate) fn row_range(&self, row: usize) -> std::ops::Range<usize> {
        self.row_starts[row] as usize..self.row_starts[row + 1] as usize
    }
}

/// Bits of a word.
pub(crate) const WORD: usize = 64;

/// Properties of the pixels of a row, one bit per pixel, the first pixel in the lowest bit.
#[derive(Clone, Default)]
pub(crate) struct RowBits {
    pub(crate) inside: Vec<u64>,
    /// First pixel of a run.
    pub(crate) begins: Vec<u64>,
    /// Connected with the pixel above.
    pub(crate) up: Vec<u64>,
    /// Connected with the pixel above and to the left.
    pub(crate) up_left: Vec<u64>,
    /// The pixel to the left is connected with the pixel above this pixel.
    pub(crate) left_up: Vec<u64>,
}

impl RowBits {
    pub(crate) fn new(cols: usize) -> Self {
        let none = vec![0; cols.div_ceil(WORD)];
        Self { inside: none.clone(), begins: none.clone(), up: none.clone(), up_left: none.clone(), left_up: none }
    }
}

/// Builds runs row by row.
pub(crate) struct Builder {
    cols: usize,
    runs: Runs,
    /// Sets of connected runs, in the order of their first runs. Until [`Builder::finish`], labels are sets.
    sets: DisjointSets,
    begins_above: Vec<u64>,
    firsts: Vec<u32>,
    lasts: Vec<u32>,
}

/// Marks runs that do not touch a run above.
const NO_SET: u32 = u32::MAX;

impl Builder {
    pub(crate) fn new(cols: usize) -> Self {
        // Writes of several entries at once may exceed the last run.
        let columns = vec![0; cols + WORD];
        Self {
            cols,
            runs: Runs { row_starts: vec![0], ..Runs::default() },
            sets: DisjointSets::new(0),
            begins_above: vec![0; cols.div_ceil(WORD)],
            firsts: columns.clone(),
            lasts: columns,
        }
    }

    #[inline(always)]
    pub(crate) fn add_row(&mut self, bits: &RowBits, connectivity: Connectivity) {
        self.find_runs(bits);
        let n = self.runs.row_starts.len();
        if n > 1 {
            self.join(bits, [self.runs.row_starts[n - 2], self.runs.row_starts[n - 1]], connectivity);
        }
        for set in &mut self.runs.labels[self.runs.row_starts[n - 1] as usize..] {
            if *set == NO_SET {
                *set = self.sets.add();
            }
        }
        self.runs.row_starts.push(self.runs.ends.len() as u32);
        self.begins_above.copy_from_slice(&bits.begins);
    }

    #[inline(always)]
    fn find_runs(&mut self, bits: &RowBits) {
        let mut n_firsts = 0;
        let mut n_lasts = 0;
        let mut before = 0;
        for (idx, (&inside, &begins)) in bits.inside.iter().zip(&bits.begins).enumerate() {
            let col = (idx * WORD) as u32;
            n_firsts += list(begins, col, &mut self.firsts[n_firsts..]);
            n_lasts +=
                list(shift_right_by_one_pixel(inside, before) & (begins | !inside), col, &mut self.lasts[n_lasts..]);
            before = inside;
        }
        if n_lasts < n_firsts {
            self.lasts[n_lasts] = self.cols as u32;
        }
        self.runs.ends.extend(self.firsts[..n_firsts].iter().zip(&self.lasts).map(|(&first, &last)| [first, last]));
        self.runs.labels.resize(self.runs.ends.len(), NO_SET);
    }

    /// Assigns the sets of touching runs above to the runs of a row. `n_begun` are the numbers of runs before the row above and before
    /// this row.
    #[inline(always)]
    fn join(&mut self, bits: &RowBits, n_begun: [u32; 2], connectivity: Connectivity) {
        let [mut n_above, mut n_below] = n_begun;
        let mut up_before = 0;
        for idx in 0..bits.begins.len() {
            let above = self.begins_above[idx];
            let below = bits.begins[idx];
            let up = bits.up[idx];
            let up_of_left = shift_right_by_one_pixel(up, up_before);
            // A contact is processed only where a run begins, so that two touching runs are mostly joined once.
            let mut contacts = up & (!up_of_left | above | below);
            let [mut to_left, mut from_left] = [0; 2];
            if connectivity == Connectivity::Eight {
                to_left = bits.up_left[idx] & (!up | above) & (!up_of_left | below);
                from_left = bits.left_up[idx] & (!up | below) & (!up_of_left | above);
                contacts |= to_left & !above | from_left & !below;
            }
            for (contacts, lags) in [(contacts, [0, 0]), (to_left & above, [1, 0]), (from_left & below, [0, 1])] {
                self.touch(contacts, [(n_above, above), (n_below, below)], lags);
            }
            n_above += above.count_ones();
            n_below += below.count_ones();
            up_before = up;
        }
    }

    /// Joins, for each contact, the last run above and the last run below that begin at or before its pixel, or the pixel before (`lags`).
    /// `above` and `below` are the number of runs before this word, and the beginnings of runs in this word.
    #[inline(always)]
    fn touch(&mut self, mut contacts: u64, [above, below]: [(u32, u64); 2], lags: [u32; 2]) {
        while contacts != 0 {
            let up_to_here = contacts ^ (contacts - 1);
            let last = |(n, begins): (u32, u64), lag: u32| (n + (begins & up_to_here >> lag).count_ones()) as usize - 1;
            let set_above = self.sets.parent(self.runs.labels[last(above, lags[0])]);
            let set = &mut self.runs.labels[last(below, lags[1])];
            *set = if *set == NO_SET { set_above } else { *set };
            if *set != set_above {
                *set = self.sets.union(*set as usize, set_above as usize) as u32;
            }
            contacts &= contacts - 1;
        }
    }

    /// Converts sets to labels in raster order of the first pixels of the components.
    pub(crate) fn finish(self) -> Runs {
        let Self { mut runs, sets, .. } = self;
        let (numbers, n_labels) = sets.into_numbers();
        for label in &mut runs.labels {
            *label = numbers[*label as usize];
        }
        runs.n_labels = n_labels;
        runs
    }
}

/// For each pixel, the bit of the pixel to its left. `before` is the previous word.
#[inline(always)]
pub(crate) fn shift_right_by_one_pixel(word: u64, before: u64) -> u64 {
    word << 1 | before >> (WORD - 1)
}

/// Bits of a word that are listed together.
const BURST: usize = 16;

/// Writes the positions of the set bits, plus `first`, and returns their number. Entries after them are undefined.
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

/// Writes one bit per pixel.
#[inline(always)]
pub(crate) fn write_words(pixels: &[bool], into: &mut [u64]) {
    for (word, pixels) in into.iter_mut().zip(pixels.chunks(WORD)) {
        *word = word_of(pixels);
    }
}

/// One bit for each of up to 64 pixels, the first in the lowest bit.
#[inline(always)]
fn word_of(pixels: &[bool]) -> u64 {
    let mut word = 0;
    let (eights, rest) = pixels.as_chunks::<8>();
    for (i, eight) in eights.iter().enumerate() {
        // Collects the lowest bits of eight bytes in the highest byte.
        let bits = u64::from_le_bytes(eight.map(u8::from)).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        word |= bits << (8 * i);
    }
    for (i, &pixel) in rest.iter().enumerate() {
        word |= u64::from(pixel) << (8 * eights.len() + i);
    }
    word
}
