//! Votes of all sweeps that saw a place.

use super::softmax::{MAX_CLASSES, Vote};
use geometry::NO_POINT;
use messages::SubmapPoint;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Coordinates are counted in cells from here, so that they are positive, and stay in 21 bits each: +-100 km in cells of
/// 0.1 m.
const OFFSET: i64 = 1 << 20;
const MASK: i64 = (1 << 21) - 1;

/// Cells of up to 2^4 times the side decide for those without votes: 3.2 m of 0.2 m, the distance of an HDL-32E's rings on the
/// road 20 m away.
const COARSER: u32 = 4;

/// Probabilities of classes for every point.
pub(super) struct Votes<'a> {
    /// Classes.
    pub n_classes: usize,
    /// Of all pixels of all sweeps.
    pub of_pixels: &'a [Vote],
    /// Which of them each point has; [`NO_POINT`] for a point without a vote.
    pub pixel_of_point: &'a [u32],
}

/// Numbers of cells by their keys.
type Cells = HashMap<u64, u32, BuildHasherDefault<CellHasher>>;

/// Best class and its share of the votes.
type Decision = Option<(usize, f32)>;

impl Votes<'_> {
    /// Gives every point the mean of the votes within its cell of `cell_m`, or, where nobody voted, within the smallest of the
    /// cells of 2, 4, 8, 16 times the side around it that have votes; `None` if none has. Cells count in the submap's frame.
    pub fn decide(&self, points: &[SubmapPoint], cell_m: f32) -> impl Iterator<Item = Decision> + use<> {
        let n = self.n_classes;
        let (mut number_of_cell, mut cells, mut sums) = (Cells::default(), Vec::new(), Vec::new());
        // A laser's next point mostly lies where its last one lay.
        let mut last_of_ring = vec![Last::default(); 256];
        let add = |(point, &pixel): (&SubmapPoint, &u32)| {
            let cell = cell(point, cell_m);
            let last = &mut last_of_ring[usize::from(point.ring)];
            if last.cell != cell {
                last.hand_in(&mut sums);
                let number = *number_of_cell.entry(cell).or_insert(cells.len() as u32);
                if number as usize == cells.len() {
                    cells.push(cell);
                    sums.resize(sums.len() + n, 0_u32);
                }
                *last = Last { cell, first: number as usize * n, n, ..Last::default() };
            }
            if pixel != NO_POINT {
                let votes = last.sums.iter_mut().zip(&self.of_pixels[pixel as usize]);
                votes.for_each(|(sum, vote)| *sum += u32::from(*vote));
            }
            (last.first / n) as u32
        };
        let numbers: Vec<u32> = points.iter().zip(self.pixel_of_point).map(add).collect();
        for last in &last_of_ring {
            last.hand_in(&mut sums);
        }
        let mut decisions: Vec<Decision> = sums.chunks_exact(n).map(decide).collect();
        for level in 1..=COARSER {
            self.decide_coarsely(&cells, &sums, level, &mut decisions);
        }
        numbers.into_iter().map(move |number| decisions[number as usize])
    }

    /// Decides cells without votes by those around them, in cells of 2^`level` times the side.
    fn decide_coarsely(&self, cells: &[u64], sums: &[u32], level: u32, decisions: &mut [Decision]) {
        let n = self.n_classes;
        let mut number_of_cell = Cells::default();
        for (cell, _) in cells.iter().zip(decisions.iter()).filter(|(_, decision)| decision.is_none()) {
            let next = number_of_cell.len() as u32;
            number_of_cell.entry(coarser(*cell, level)).or_insert(next);
        }
        if number_of_cell.is_empty() {
            return;
        }
        let mut coarse_sums = vec![0_u32; number_of_cell.len() * n];
        for (cell, sums) in cells.iter().zip(sums.chunks_exact(n)) {
            if let Some(&number) = number_of_cell.get(&coarser(*cell, level)) {
                let coarse = &mut coarse_sums[number as usize * n..][..n];
                coarse.iter_mut().zip(sums).for_each(|(sum, votes)| *sum += votes);
            }
        }
        for (cell, decision) in cells.iter().zip(decisions).filter(|(_, decision)| decision.is_none()) {
            let number = number_of_cell[&coarser(*cell, level)] as usize;
            *decision = decide(&coarse_sums[number * n..][..n]);
        }
    }
}

/// The cell that a laser saw last, and its votes there since.
#[derive(Clone, Copy)]
struct Last {
    cell: u64,
    /// Where the cell's sums begin, and how many there are.
    first: usize,
    n: usize,
    sums: [u32; MAX_CLASSES],
}

impl Default for Last {
    fn default() -> Self {
        Self { cell: u64::MAX, first: 0, n: 0, sums: [0; MAX_CLASSES] }
    }
}

impl Last {
    fn hand_in(&self, sums: &mut [u32]) {
        let sums = &mut sums[self.first..][..self.n];
        sums.iter_mut().zip(&self.sums).for_each(|(sum, votes)| *sum += votes);
    }
}

/// The class with the most votes, the first of equals: the order of the classes decides, not that of the points.
fn decide(sums: &[u32]) -> Decision {
    let total: u32 = sums.iter().sum();
    let best = (0..sums.len()).rev().max_by_key(|&class| sums[class]);
    best.filter(|_| total > 0).map(|class| (class, sums[class] as f32 / total as f32))
}

/// The cell of 2^`level` times the side that a cell is part of.
fn coarser(cell: u64, level: u32) -> u64 {
    let keep = MASK as u64 >> level << level;
    cell & (keep << 42 | keep << 21 | keep)
}

/// Spreads the numbers of cells by one multiplication (Fibonacci hashing, Knuth vol. 3, 6.4): they come from places, not from
/// those who wish the table ill.
#[derive(Default)]
struct CellHasher(u64);

impl Hasher for CellHasher {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, _: &[u8]) {
        unreachable!("cells are u64");
    }
    fn write_u64(&mut self, cell: u64) {
        let product = cell.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        // The table takes its place from the low bits, which a product mixes least.
        self.0 = product ^ product >> 32;
    }
}

/// A point that is no number shares a cell with others of its kind only if they have votes, which they have not.
fn cell(point: &SubmapPoint, cell_m: f32) -> u64 {
    // The floor, without a call of the library.
    let floor = |v: f64| v as i64 - i64::from(v < (v as i64) as f64);
    let count = |v: f32| (floor(f64::from(v) / f64::from(cell_m)) + OFFSET) & MASK;
    (count(point.x) << 42 | count(point.y) << 21 | count(point.z)) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vote([first, second]: [u8; 2]) -> Vote {
        let mut vote = [0; MAX_CLASSES];
        vote[..2].copy_from_slice(&[first, second]);
        vote
    }

    #[test]
    fn a_cell_has_one_class_and_unseen_points_have_it_too() {
        let at = |x: f32| SubmapPoint { x, ..SubmapPoint::default() };
        let points = [at(0.01), at(0.05), at(0.19), at(0.21), at(-0.01), at(5.0)];
        let of_pixels = [[200, 55], [100, 155], [10, 245], [255, 0]].map(vote);
        let pixel_of_point = &[0, 1, NO_POINT, 2, 3, NO_POINT];
        let votes = Votes { n_classes: 2, of_pixels: &of_pixels, pixel_of_point };
        let decided: Vec<Decision> = votes.decide(&points, 0.2).collect();
        let near = |got: Option<(usize, f32)>, class: usize, share: f32| {
            let (got_class, got_share) = got.expect("has votes");
            assert!(got_class == class && (got_share - share).abs() < 1e-6, "{got_class} {got_share}");
        };
        for decision in &decided[..3] {
            near(*decision, 0, 300.0 / 510.0);
        }
        near(decided[3], 1, 245.0 / 255.0);
        near(decided[4], 0, 1.0);
        assert_eq!(decided[5], None);
    }

    #[test]
    fn a_cell_without_votes_takes_the_class_of_the_smallest_cell_around_it_that_has_some() {
        let at = |x: f32, z: f32| SubmapPoint { x, z, ..SubmapPoint::default() };
        // Voters of class 0 in the cell at 0, of class 1 in that at 0.6; without votes at 0.2, 0.4, 1.0 and 9.
        let points = [at(0.1, 0.1), at(0.3, 0.1), at(0.5, 0.1), at(0.7, 0.1), at(1.1, 0.1), at(9.0, 0.1)];
        let none = NO_POINT;
        let of_pixels = [[255, 0], [55, 200]].map(vote);
        let votes = Votes { n_classes: 2, of_pixels: &of_pixels, pixel_of_point: &[0, none, none, 1, none, none] };
        let classes: Vec<Option<usize>> =
            votes.decide(&points, 0.2).map(|decision| decision.map(|(class, _)| class)).collect();
        assert_eq!(classes, [Some(0), Some(0), Some(1), Some(1), Some(0), None]);
    }
}
