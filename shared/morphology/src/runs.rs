//! Parts of an image by runs: stretches of a row that belong together, and which runs of the row above they touch. Branches that
//! depend on where runs begin cannot be foreseen, so all that is asked of pixels is a bit of a word, and runs are found and joined
//! many pixels at a time.

use crate::Connectivity;
use crate::union_find::DisjointSets;

/// All runs of an image in raster order, and the parts that they make up.
#[derive(Default)]
pub(crate) struct Runs {
    /// First column, and the one after the last.
    pub(crate) ends: Vec<[u32; 2]>,
    /// Label of each run.
    pub(crate) labels: Vec<u32>,
    pub(crate) n_labels: usize,
    /// Index of each row's first run, and the number of runs.
    row_starts: Vec<u32>,
}

impl Runs {
    /// Indices of the runs of a row.
    pub(crate) fn of_row(&self, row: usize) -> std::ops::Range<usize> {
        self.row_starts[row] as usize..self.row_starts[row + 1] as usize
    }
}

/// Bits of a word.
pub(crate) const WORD: usize = 64;

/// What is known of each pixel of a row, a bit each, the first lowest.
#[derive(Clone, Default)]
pub(crate) struct RowBits {
    pub(crate) inside: Vec<u64>,
    /// Inside, and not of one run with the pixel to the left.
    pub(crate) begins: Vec<u64>,
    /// Belongs to the pixel above.
    pub(crate) up: Vec<u64>,
    /// Belongs to the pixel above and to the left.
    pub(crate) up_left: Vec<u64>,
    /// The pixel to the left belongs to the one above this.
    pub(crate) left_up: Vec<u64>,
}

impl RowBits {
    pub(crate) fn new(cols: usize) -> Self {
        let none = vec![0; cols.div_ceil(WORD)];
        Self { inside: none.clone(), begins: none.clone(), up: none.clone(), up_left: none.clone(), left_up: none }
    }
}

/// Runs of the rows so far.
pub(crate) struct Builder {
    cols: usize,
    runs: Runs,
    /// Runs that are known to belong together, in the order of their first runs. Labels are sets as yet.
    sets: DisjointSets,
    begins_above: Vec<u64>,
    firsts: Vec<u32>,
    lasts: Vec<u32>,
}

/// No run above is known yet that a run touches.
const NO_SET: u32 = u32::MAX;

impl Builder {
    pub(crate) fn new(cols: usize) -> Self {
        // What is written at once may reach past the last run.
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
        let (mut n_firsts, mut n_lasts) = (0, 0);
        let mut before = 0;
        for (idx, (&inside, &begins)) in bits.inside.iter().zip(&bits.begins).enumerate() {
            let col = (idx * WORD) as u32;
            n_firsts += list(begins, col, &mut self.firsts[n_firsts..]);
            n_lasts += list(to_the_left(inside, before) & (begins | !inside), col, &mut self.lasts[n_lasts..]);
            before = inside;
        }
        if n_lasts < n_firsts {
            self.lasts[n_lasts] = self.cols as u32;
        }
        self.runs.ends.extend(self.firsts[..n_firsts].iter().zip(&self.lasts).map(|(&first, &last)| [first, last]));
        self.runs.labels.resize(self.runs.ends.len(), NO_SET);
    }

    /// Gives the runs of a row the sets of the runs above that they touch. `n_begun`: runs before the row above and before this.
    #[inline(always)]
    fn join(&mut self, bits: &RowBits, n_begun: [u32; 2], connectivity: Connectivity) {
        let [mut n_above, mut n_below] = n_begun;
        let mut up_before = 0;
        for idx in 0..bits.begins.len() {
            let (above, below, up) = (self.begins_above[idx], bits.begins[idx], bits.up[idx]);
            let up_and_left = to_the_left(up, up_before);
            // Once for two runs that touch, if it can be: not again where neither of them begins.
            let mut contacts = up & (!up_and_left | above | below);
            let [mut to_left, mut from_left] = [0; 2];
            if connectivity == Connectivity::Eight {
                to_left = bits.up_left[idx] & (!up | above) & (!up_and_left | below);
                from_left = bits.left_up[idx] & (!up | below) & (!up_and_left | above);
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

    /// For each contact, the last run above and the last below that have begun there, or a pixel before, belong together. Of both
    /// rows, how many runs began before this word, and where others begin.
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

    /// Labels in raster order of the parts' first pixels.
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

/// Of each pixel, the bit of the one to its left; `before` is the word before.
#[inline(always)]
pub(crate) fn to_the_left(word: u64, before: u64) -> u64 {
    word << 1 | before >> (WORD - 1)
}

/// Bits of a word that are listed at once.
const BURST: usize = 16;

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

/// A bit for each pixel.
#[inline(always)]
pub(crate) fn write_words(pixels: &[bool], into: &mut [u64]) {
    for (word, pixels) in into.iter_mut().zip(pixels.chunks(WORD)) {
        *word = word_of(pixels);
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
