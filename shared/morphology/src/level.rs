//! Values that a pixel can have.

use std::cmp::Ordering;

/// A pixel value with a total order, a least and a greatest element (the neutral elements of dilation and erosion) and an
/// order-reversing complement.
///
/// `f32`: -0 and +0 are one level where values are compared, and -0 comes first where they are sorted. NaN has no place in
/// an image; it would give some value in every pixel that looks at it, and never stop the program.
pub trait Level: Copy + PartialOrd {
    /// Below or equal to every value.
    const LOWEST: Self;
    /// Above or equal to every value.
    const HIGHEST: Self;
    /// Ranks that values can have, `None` if they are too many for a table.
    const N_RANKS: Option<usize>;
    /// Rises with the value.
    fn rank(self) -> u32;
    /// Turns the order around; twice is nothing. What holds of peaks then holds of pits.
    #[must_use]
    fn complement(self) -> Self;
    /// The total order.
    #[inline(always)]
    fn order(self, other: Self) -> Ordering {
        self.rank().cmp(&other.rank())
    }
    /// The greater of two.
    #[inline(always)]
    #[must_use]
    fn sup(self, other: Self) -> Self {
        // In this form it is one instruction for f32, too, over as many pixels as a register holds.
        if self > other { self } else { other }
    }
    /// The lesser of two.
    #[inline(always)]
    #[must_use]
    fn inf(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
}

macro_rules! whole_numbers {
    ($($t:ty: $n_ranks:expr;)*) => {$(
        impl Level for $t {
            const LOWEST: Self = <$t>::MIN;
            const HIGHEST: Self = <$t>::MAX;
            const N_RANKS: Option<usize> = $n_ranks;
            #[inline(always)]
            fn rank(self) -> u32 {
                u32::from(self)
            }
            #[inline(always)]
            fn complement(self) -> Self {
                !self
            }
        }
    )*};
}
whole_numbers! {
    u8: Some(1 << 8);
    u16: Some(1 << 16);
    u32: None;
}

impl Level for bool {
    const LOWEST: Self = false;
    const HIGHEST: Self = true;
    const N_RANKS: Option<usize> = Some(2);
    #[inline(always)]
    fn rank(self) -> u32 {
        u32::from(self)
    }
    #[inline(always)]
    fn complement(self) -> Self {
        !self
    }
    #[inline(always)]
    fn sup(self, other: Self) -> Self {
        self | other
    }
    #[inline(always)]
    fn inf(self, other: Self) -> Self {
        self & other
    }
}

impl Level for f32 {
    const LOWEST: Self = f32::NEG_INFINITY;
    const HIGHEST: Self = f32::INFINITY;
    const N_RANKS: Option<usize> = None;
    /// That of [`f32::total_cmp`].
    #[inline(always)]
    fn rank(self) -> u32 {
        let bits = self.to_bits();
        let sign = (bits as i32 >> 31) as u32;
        bits ^ (sign | 0x8000_0000)
    }
    #[inline(always)]
    fn complement(self) -> Self {
        -self
    }
}
