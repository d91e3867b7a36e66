//! The rim of what the LiDAR hits in an exposure, where something else may be seen behind it.

use crate::visibility::VisibilityMap;
use pulp::{Arch, NullaryFnOnce};

/// Width of the rim on both sides, cells: 0.3 m at a range of 10 m. The sky is seen through foliage that is less than half a
/// metre thick, which the outer part of a round crown is.
const WIDTH: usize = 8;

/// Shifts that reach all cells within `WIDTH`, one after another: none is larger than the number of cells reached to one side.
const SHIFTS: [usize; 4] = [1, 2, 4, 1];
const _: () = assert!(SHIFTS[0] + SHIFTS[1] + SHIFTS[2] + SHIFTS[3] == WIDTH);

/// What the LiDAR hits in a cell of an exposure and up to `WIDTH` cells around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surroundings {
    /// Surfaces.
    Surface,
    /// Surfaces and nothing.
    Rim,
    /// Nothing.
    Nothing,
}

/// The surroundings of every cell of an exposure.
#[derive(Debug)]
pub struct RimMap {
    /// Per cell, row by row: whether there is a surface near it (1), and nothing (2).
    near: Vec<u8>,
}

impl RimMap {
    /// Of the cells of a visibility map.
    pub fn new(visibility: &VisibilityMap) -> Self {
        let [columns, _] = visibility.grid.size();
        let mut near: Vec<u8> = visibility.is_hit().iter().map(|is_hit| if *is_hit { 1 } else { 2 }).collect();
        for shift in SHIFTS {
            near = join(&near, near.len(), shift * columns);
        }
        for shift in SHIFTS {
            near = join(&near, columns, shift);
        }
        Self { near }
    }

    /// The surroundings of a cell. Nothing if there is no such cell.
    pub fn surroundings(&self, cell: u32) -> Surroundings {
        match self.near.get(cell as usize) {
            Some(1) => Surroundings::Surface,
            Some(3) => Surroundings::Rim,
            _ => Surroundings::Nothing,
        }
    }
}

/// Adds to every cell the bits of those `by` cells before and after it in the same line of `len` cells.
fn join(near: &[u8], len: usize, by: usize) -> Vec<u8> {
    let mut out = near.to_vec();
    let by = by.min(len);
    for (out, near) in out.chunks_exact_mut(len).zip(near.chunks_exact(len)) {
        Arch::new().dispatch(Or { out: &mut out[..len - by], with: &near[by..] });
        Arch::new().dispatch(Or { out: &mut out[by..], with: &near[..len - by] });
    }
    out
}

struct Or<'a> {
    out: &'a mut [u8],
    with: &'a [u8],
}

impl NullaryFnOnce for Or<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.out.iter_mut().zip(self.with).for_each(|(a, b)| *a |= b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_reach_all_cells_within_width_and_stay_in_line() {
        let mut near = vec![0; 3 * 40];
        near[40 + 10] = 1;
        near[40 + 39] = 2;
        for shift in SHIFTS {
            near = join(&near, 40, shift);
        }
        let row: Vec<u8> = (0..40).map(|x| u8::from((2..=18).contains(&x)) + if x >= 31 { 2 } else { 0 }).collect();
        assert_eq!(near[40..80], row);
        assert!(near[..40].iter().chain(&near[80..]).all(|bits| *bits == 0));
        assert_eq!(join(&[1, 2], 2, 5), [1, 2], "a line shorter than the shift");
    }
}
