//! Pixel values.

use std::cmp::Ordering;

/// A pixel value with a total order, a lowest and a highest element (the neutral elements of dilation and erosion) and a complement
/// that reverses the order.
///
/// `f32`: -0 and +0 are equal in comparisons; sorting puts -0 first. Images must not contain NaN. Results near NaN are unspecified,
/// without panics.
pub trait Level: Copy + PartialOrd {
    /// Lowest value.
    const LOWEST: Self;
    /// Highest value.
    const HIGHEST: Self;
    /// Number of ranks, `None` if too large for a table.
    const N_RANKS: Option<usize>;
    /// Position in the order of values.
    fn rank(self) -> u32;
    /// The value with reversed order. Applied twice it is the identity. It converts operators for peaks to operators for pits.
    #[must_use]
    fn complement(self) -> Self;
    /// The total order.
    #[inline(always)]
    fn order(self, other: Self) -> Ordering {
        self.rank().cmp(&other.rank())
    }
    /// Maximum.
    #[inline(always)]
    #[must_use]
    fn sup(self, other: Self) -> Self {
        // This form is a single vector instruction for f32 as well.
        if self > other { self } else { other }
    }
    /// Minimum.
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
    /// Order of [`f32::total_cmp`].
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
