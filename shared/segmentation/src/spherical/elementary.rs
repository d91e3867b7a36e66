//! Exponential and hyperbolic tangent without branches, so that loops over them are vectorized. Every processor gives the same bits:
//! no library function and no fused operation is used.

/// Constant 1.5 x 2^23: adding a number to it rounds the number to an integer.
const ROUNDER: f32 = 12_582_912.0;

/// Computes e^x within 3 units of the last place for x in -87 to 88; x is clamped to this range.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    let x = x.clamp(-87.0, 88.0);
    let rounded = x * std::f32::consts::LOG2_E + ROUNDER;
    let n = rounded - ROUNDER;
    // ln 2 in two parts, so that the remainder has full precision (Cody and Waite).
    let rest = x - n * 0.693_359_4 + n * 2.121_944_4e-4;
    // Polynomial of Cephes for e^rest, |rest| < 0.35.
    let mut sum = 1.987_569_1e-4;
    for coefficient in [1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5] {
        sum = sum * rest + coefficient;
    }
    let fraction = sum * rest * rest + rest + 1.0;
    // The integer is in the lowest bits of `rounded`.
    fraction * f32::from_bits((rounded.to_bits() << 23).wrapping_add(1.0_f32.to_bits()))
}

/// Computes tanh x within 3e-7.
#[inline(always)]
pub(super) fn tanh(x: f32) -> f32 {
    1.0 - 2.0 / (exp(2.0 * x) + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_and_tanh_match_library_within_tolerance() {
        for i in -86_900..88_000 {
            let x = i as f32 * 1e-3;
            let expected = f64::from(x).exp();
            assert!((f64::from(exp(x)) / expected - 1.0).abs() < 4e-7, "{x}: {} {expected}", exp(x));
            assert!((f64::from(tanh(x)) - f64::from(x).tanh()).abs() < 3e-7, "{x}: {}", tanh(x));
        }
        assert_eq!((exp(0.0), tanh(0.0)), (1.0, 0.0));
        assert_eq!((exp(f32::NEG_INFINITY), exp(-1e30)), (exp(-87.0), exp(-87.0)));
        assert_eq!((tanh(1e30), tanh(-1e30)), (1.0, -1.0));
    }
}
