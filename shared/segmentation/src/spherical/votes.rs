//! Votes of all sweeps in cells of space.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over constant bounds become vector instructions; iterators and calls in between do not"
)]

use super::softmax::{MAX_CLASSES, Vote};
use crate::CellProbabilities;
use messages::SubmapPoint;
use pulp::{Arch, NullaryFnOnce};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Added to cell coordinates so that they are positive numbers of 21 bits: +-100 km in cells of 0.1 m.
const OFFSET: i64 = 1 << 20;
const MASK: i64 = (1 << 21) - 1;

/// Largest level of coarser cells. Cells without votes take the votes of cells with up to 2^4 times the side: 3.2 m for
/// 0.2 m, the distance between the rings of an HDL-32E on the road at 20 m.
const COARSER: u32 = 4;

/// Probabilities of classes for every point.
pub(super) struct Votes<'a> {
    /// The vote of each point, which is the vote of its pixel; zeros without a pixel. It is in the order of the points
    /// instead of the pixels because all sweeps of a submap do not fit into the cache.
    pub of_points: &'a [Vote],
}

/// Points whose cells are computed together.
const CHUNK: usize = 64;

/// Sums of votes by class.
type Sums = [u32; MAX_CLASSES];

/// Indices of cells by their keys.
type Cells = HashMap<u64, u32, BuildHasherDefault<CellHasher>>;

impl Votes<'_> {
    /// Shares of the first `n_classes` classes in the votes of each cell, of side `cell_m` in the submap frame. A cell
    /// without votes has the shares of the smallest surrounding cell of 2, 4, 8, 16 times the side with votes; zeros if
    /// there is no such cell.
    pub fn shares(&self, points: &[SubmapPoint], cell_m: f32, n_classes: usize) -> CellProbabilities {
        let cast = Cast { votes: self, points, cell_m };
        let Ballots { cells, mut sums, number_of_point } = Arch::new().dispatch(cast);
        let is_open: Vec<bool> = sums.iter().map(|votes| *votes == [0; MAX_CLASSES]).collect();
        for level in 1..=COARSER {
            fill_coarsely(&cells, &is_open, level, &mut sums);
        }
        let mut shares = Vec::with_capacity(sums.len() * n_classes);
        for votes in &sums {
            let total = votes.iter().sum::<u32>().max(1) as f32;
            shares.extend(votes[..n_classes].iter().map(|votes| *votes as f32 / total));
        }
        CellProbabilities::new(n_classes, shares, number_of_point)
    }
}

/// The cells in the order of their first points.
struct Ballots {
    cells: Vec<u64>,
    sums: Vec<Sums>,
    /// Index of the cell of each point.
    number_of_point: Vec<u32>,
}

/// Sums the votes.
struct Cast<'a> {
    votes: &'a Votes<'a>,
    points: &'a [SubmapPoint],
    cell_m: f32,
}

impl NullaryFnOnce for Cast<'_> {
    type Output = Ballots;

    #[inline(always)]
    fn call(self) -> Ballots {
        let Self { votes, points, cell_m } = self;
        let mut numbers = Cells::default();
        let mut cells = Vec::new();
        let mut sums = Vec::new();
        let mut number_of_point = Vec::with_capacity(points.len());
        // Consecutive points of a ring are mostly in the same cell.
        let mut last_of_ring = vec![Last { cell: u64::MAX, number: 0, sums: [0; MAX_CLASSES] }; 256];
        for (points, votes) in points.chunks(CHUNK).zip(votes.of_points.chunks(CHUNK)) {
            // A separate loop, which is vectorized.
            let mut cell_of_point = [0; CHUNK];
            for (cell, point) in cell_of_point.iter_mut().zip(points) {
                *cell = cell_of(point, cell_m);
            }
            for ((&cell, point), vote) in cell_of_point.iter().zip(points).zip(votes) {
                let last = &mut last_of_ring[usize::from(point.ring)];
                if last.cell != cell {
                    last.flush(&mut sums);
                    let number = *numbers.entry(cell).or_insert(cells.len() as u32);
                    if number as usize == cells.len() {
                        cells.push(cell);
                        sums.push([0; MAX_CLASSES]);
                    }
                    *last = Last { cell, number, sums: [0; MAX_CLASSES] };
                }
                let mut sums = last.sums;
                for class in 0..MAX_CLASSES {
                    sums[class] += u32::from(vote[class]);
                }
                last.sums = sums;
                number_of_point.push(last.number);
            }
        }
        for last in &last_of_ring {
            last.flush(&mut sums);
        }
        Ballots { cells, sums, number_of_point }
    }
}

/// Gives cells that still have no votes the votes of cells with 2^`level` times the side. `is_open` marks the cells
/// that were empty at first: only the votes of the others count.
fn fill_coarsely(cells: &[u64], is_open: &[bool], level: u32, sums: &mut [Sums]) {
    let is_empty = |sums: &Sums| *sums == [0; MAX_CLASSES];
    let mut number_of_cell = Cells::default();
    for (cell, _) in cells.iter().zip(&*sums).filter(|(_, sums)| is_empty(sums)) {
        let next = number_of_cell.len() as u32;
        number_of_cell.entry(coarser(*cell, level)).or_insert(next);
    }
    if number_of_cell.is_empty() {
        return;
    }
    let mut coarse_sums: Vec<Sums> = vec![[0; MAX_CLASSES]; number_of_cell.len()];
    for ((cell, sums), _) in cells.iter().zip(&*sums).zip(is_open).filter(|(_, is_open)| !**is_open) {
        if let Some(&number) = number_of_cell.get(&coarser(*cell, level)) {
            add(&mut coarse_sums[number as usize], sums);
        }
    }
    for (cell, sums) in cells.iter().zip(sums).filter(|(_, sums)| is_empty(sums)) {
        *sums = coarse_sums[number_of_cell[&coarser(*cell, level)] as usize];
    }
}

/// The last cell of a ring, and the votes since it was entered.
#[derive(Clone, Copy)]
struct Last {
    cell: u64,
    number: u32,
    sums: Sums,
}

impl Last {
    #[inline(always)]
    fn flush(&self, sums: &mut [Sums]) {
        if self.cell != u64::MAX {
            add(&mut sums[self.number as usize], &self.sums);
        }
    }
}

#[inline(always)]
fn add(sums: &mut Sums, votes: &Sums) {
    for class in 0..MAX_CLASSES {
        sums[class] += votes[class];
    }
}

/// The cell of 2^`level` times the side that contains a cell.
fn coarser(cell: u64, level: u32) -> u64 {
    let keep = MASK as u64 >> level << level;
    cell & (keep << 42 | keep << 21 | keep)
}

/// Hashes keys of cells with one multiplication (Fibonacci hashing, Knuth vol. 3, 6.4). Keys come from positions;
/// protection against malicious keys is not needed.
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
        // The table uses the low bits, which a product mixes least.
        self.0 = product ^ product >> 32;
    }
}

/// The cell of a point. Points with NaN coordinates have no votes, so their cell does not matter.
#[inline(always)]
fn cell_of(point: &SubmapPoint, cell_m: f32) -> u64 {
    // The floor, without a library call.
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
    fn points_without_vote_get_class_of_their_cell() {
        let at = |x: f32| SubmapPoint { x, ..SubmapPoint::default() };
        let points = [at(0.01), at(0.05), at(0.19), at(0.21), at(-0.01), at(5.0)];
        let none = [0, 0];
        let of_points = [[200, 55], [100, 155], none, [10, 245], [255, 0], none].map(vote);
        let votes = Votes { of_points: &of_points };
        let shares = votes.shares(&points, 0.2, 2);
        let shares: Vec<Option<&[f32]>> = shares.per_point().collect();
        let of = |votes: [u16; 2]| votes.map(|of_class| f32::from(of_class) / f32::from(votes[0] + votes[1]));
        let expected = [[300, 210], [300, 210], [300, 210], [10, 245], [255, 0]].map(of);
        for (share, expected) in shares.iter().zip(&expected) {
            assert_eq!(*share, Some(expected.as_slice()));
        }
        assert_eq!(shares[5], None);
    }

    #[test]
    fn cell_without_votes_gets_class_of_smallest_enclosing_cell_with_votes() {
        let at = |x: f32, z: f32| SubmapPoint { x, z, ..SubmapPoint::default() };
        // Votes for class 0 in the cell at 0, for class 1 in the cell at 0.6; no votes at 0.2, 0.4, 1.0 and 9.
        let points = [at(0.1, 0.1), at(0.3, 0.1), at(0.5, 0.1), at(0.7, 0.1), at(1.1, 0.1), at(9.0, 0.1)];
        let none = [0, 0];
        let of_points = [[255, 0], none, none, [55, 200], none, none].map(vote);
        let votes = Votes { of_points: &of_points };
        let best = |shares: &[f32]| usize::from(shares[1] > shares[0]);
        let classes: Vec<Option<usize>> =
            votes.shares(&points, 0.2, 2).per_point().map(|shares| shares.map(best)).collect();
        assert_eq!(classes, [Some(0), Some(0), Some(1), Some(1), Some(0), None]);
    }
}
