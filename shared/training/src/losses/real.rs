//! Number types of losses.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Mul, Sub};

/// The number types that losses are computed with: `f32` in training, `f64` to check derivatives.
pub trait Real:
    Copy + Default + Send + Sync + Sum + AddAssign + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// Smaller than all numbers.
    const LOWEST: Self;
    /// The exponential function.
    fn exp(self) -> Self;
    fn ln(self) -> Self;
    fn max(self, other: Self) -> Self;
    fn powf(self, power: f64) -> Self;
    fn from_f64(value: f64) -> Self;
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
            fn powf(self, power: f64) -> Self {
                self.powf(power as $number)
            }
            fn from_f64(value: f64) -> Self {
                value as $number
            }
        }
    )*};
}

real! { f32 f64 }
