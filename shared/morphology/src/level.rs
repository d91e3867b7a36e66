//! Values that a pixel can have.

use std::cmp::Ordering;

/// A totally ordered pixel value with a least and a greatest element, the neutral elements of dilation and erosion.
///
/// `f32` is ordered by [`f32::total_cmp`]: -0 below +0. NaN has no place in an image; it would rank beyond the infinities
/// and never stop the program.
pub trait Level: Copy {
    /// Below or equal to every value.
    const LOWEST: Self;
    /// Above or equal to every value.
    const HIGHEST: Self;
    /// The total order.
    fn order(self, other: Self) -> Ordering;
    /// The greater of two.
    #[inline]
    #[must_use]
    fn sup(self, other: Self) -> Self {
        if self.order(other) == Ordering::Less { other } else { self }
    }
    /// The lesser of two.
    #[inline]
    #[must_use]
    fn inf(self, other: Self) -> Self {
        if self.order(other) == Ordering::Greater { other } else { self }
    }
}

macro_rules! ordered_level {
    ($($t:ty: $low:expr, $high:expr;)*) => {$(
        impl Level for $t {
            const LOWEST: Self = $low;
            const HIGHEST: Self = $high;
            #[inline]
            fn order(self, other: Self) -> Ordering {
                self.cmp(&other)
            }
        }
    )*};
}
ordered_level! {
    bool: false, true;
    u8: u8::MIN, u8::MAX;
    u16: u16::MIN, u16::MAX;
    u32: u32::MIN, u32::MAX;
}

impl Level for f32 {
    const LOWEST: Self = f32::NEG_INFINITY;
    const HIGHEST: Self = f32::INFINITY;
    #[inline]
    fn order(self, other: Self) -> Ordering {
        self.total_cmp(&other)
    }
}
