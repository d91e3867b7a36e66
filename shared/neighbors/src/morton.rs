//! Morton codes: the interleaved bits of the three cell numbers. Points with neighboring codes lie near each other.

use crate::position::Bounds;

/// Number of bits per axis.
const BITS: u32 = 21;

/// Assigns codes to positions within bounds.
#[derive(Clone, Copy, Debug)]
pub struct MortonGrid {
    low: [f64; 3],
    per_m: f64,
}

impl MortonGrid {
    /// Creates cubic cells, 2^21 along the longest side of the bounds.
    pub fn from_bounds(bounds: Bounds) -> Self {
        let extent = bounds.extent();
        let per_m = if extent > 0.0 { f64::from((1_u32 << BITS) - 1) / extent } else { 0.0 };
        Self { low: bounds.low.map(f64::from), per_m }
    }
    /// Code of a position. Positions outside the bounds get the code of a cell at the border.
    #[inline]
    pub fn code(&self, p: [f32; 3]) -> u64 {
        let cell = |axis: usize| {
            // A conversion to an integer saturates, and maps NaN to 0.
            let cell = ((f64::from(p[axis]) - self.low[axis]) * self.per_m) as u64;
            spread(cell.min((1 << BITS) - 1))
        };
        cell(0) | cell(1) << 1 | cell(2) << 2
    }
}

/// Moves bit i to bit 3 i.
#[inline]
const fn spread(v: u64) -> u64 {
    let v = (v | v << 32) & 0x001f_0000_0000_ffff;
    let v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    let v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    let v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// A point and its code. The order is by code, then by point number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Entry {
    pub code: u64,
    pub point: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_interleaved() {
        for v in [0_u64, 1, 2, 3, 0x15_5555, 0x1f_ffff] {
            let expected = (0..21).fold(0, |code, bit| code | (v >> bit & 1) << (3 * bit));
            assert_eq!(spread(v), expected);
        }
    }

    #[test]
    fn corners_get_the_first_and_the_last_code() {
        let grid = MortonGrid::from_bounds(Bounds { low: [-1.0; 3], high: [3.0; 3] });
        assert_eq!(grid.code([-1.0; 3]), 0);
        assert_eq!(grid.code([3.0; 3]), (1 << 63) - 1);
        assert_eq!(grid.code([f32::NAN, -9.0, -1.0]), 0);
        assert_eq!(grid.code([9.0; 3]), (1 << 63) - 1);
    }
}
