//! Random numbers without a state: every number is a hash of its place of use, so threads share nothing.

use crate::INCREMENT;

/// Mixes 64 bits: one step of `SplitMix64`.
#[inline]
pub const fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(INCREMENT);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// One hash of a seed and an index, for streams such as "firing 17 of the lidar".
#[inline]
pub const fn hash(seed: u64, index: u64) -> u64 {
    mix(seed ^ mix(index))
}

/// Uniform in `[0, 1)`, in steps of 2^-24, from the high bits of a hash.
#[inline]
pub const fn unit(hash: u64) -> f32 {
    (hash >> 40) as f32 / (1_u32 << 24) as f32
}

/// Mean 0, variance 1, within 3.47: the sum of the four 16-bit parts of a hash (Irwin-Hall of order 4). A table or a
/// logarithm would double the time of simulated mosaics, which need 4 million per exposure.
#[inline]
pub const fn gauss(hash: u64) -> f32 {
    let sum = (hash & 0xffff) + ((hash >> 16) & 0xffff) + ((hash >> 32) & 0xffff) + (hash >> 48);
    // Each part has mean 65535 / 2 and variance (65536^2 - 1) / 12.
    (sum as f32 - 131_070.0) * (1.0 / 37_837.22)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_has_mean_zero_and_variance_one() {
        let n = 100_000;
        let samples: Vec<f64> = (0..n).map(|i| f64::from(gauss(hash(7, i)))).collect();
        let mean = samples.iter().sum::<f64>() / n as f64;
        let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n as f64;
        assert!(mean.abs() < 0.015, "{mean}");
        assert!((variance - 1.0).abs() < 0.02, "{variance}");
    }
}
