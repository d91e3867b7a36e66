//! The innermost loop of all convolutions.

#![allow(
    clippy::needless_range_loop,
    clippy::manual_memcpy,
    reason = "loops over constant bounds are what the compiler unrolls into registers; iterators and calls in between are not"
)]

use super::planes::Feature;
use pulp::Simd;

/// Adds the products of one block of input channels for `P` pixels, `SX` apart, and `C` output blocks.
#[inline(always)]
pub(super) fn add_products<S: Simd, const N: usize, const P: usize, const C: usize, const SX: usize>(
    simd: S,
    sums: &mut [[[S::f32s; N]; C]; P],
    n_channels: usize,
    pixels: &[Feature],
    weights: [&[Feature]; C],
) {
    let zero = simd.splat_f32s(0.0);
    // `..=` is avoided: it has a check that is a call if the compiler does not inline it, and a call saves all
    // registers of the sums.
    let (pixels, _) = pixels.split_at((P - 1) * SX + 1);
    for channel in 0..n_channels {
        let mut of_channel = [[zero; N]; C];
        for c in 0..C {
            let weights = S::as_simd_f32s(&weights[c][channel]).0;
            for n in 0..N {
                of_channel[c][n] = weights[n];
            }
        }
        for p in 0..P {
            let value = simd.splat_f32s(pixels[p * SX][channel]);
            for c in 0..C {
                for n in 0..N {
                    sums[p][c][n] = simd.mul_add_f32s(value, of_channel[c][n], sums[p][c][n]);
                }
            }
        }
    }
}
