//! Numbers of losses.

use std::iter::Sum;
use std::ops::{Mul, Sub};

/// The types of numbers that losses are computed with: `f32` in training, `f64` to check derivatives.
pub trait Real: Copy + Default + Send + Sync + Sum + Sub<Output = Self> + Mul<Output = Self> {
    /// Below all numbers.
    const LOWEST: Self;
    /// The power of e.
    fn exp(self) -> Self;
    fn ln(self) -> Self;
    fn max(self, other: Self) -> Self;
}

macro_rules! real {
    ($($number:ty)*) => {$(
        impl Real for $number {
            const LOWEST: Self = Self::NEG_INFINITY;
            fn exp(self) -> Self {
                self.exp()
            }
            fn ln(self) -> Self {
                self.ln()
            }
            fn max(self, other: Self) -> Self {
                self.max(other)
            }
        }
    )*};
}

real! { f32 f64 }
