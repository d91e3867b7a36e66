//! Seeded randomness without state that threads could share: every number is a hash of where it is used.

/// Mixes 64 bits (the finalizer of `SplitMix64`, Steele et al., OOPSLA 2014).
pub const fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// One hash of a seed and an index, for streams such as "firing 17 of the lidar".
pub const fn hash(seed: u64, index: u64) -> u64 {
    mix(seed ^ mix(index))
}

/// Uniform in `[0, 1)`.
pub fn unit(hash: u64) -> f32 {
    (hash >> 40) as f32 / (1_u32 << 24) as f32
}

/// Mean 0, variance 1, within 3.47: the sum of the four 16-bit parts of a hash (Irwin-Hall of order 4). A table or a
/// logarithm would double the time of the mosaics, which need 4 million per exposure.
pub fn gauss(hash: u64) -> f32 {
    let sum = (hash & 0xffff) + ((hash >> 16) & 0xffff) + ((hash >> 32) & 0xffff) + (hash >> 48);
    // Each part has mean 65535 / 2 and variance (65536^2 - 1) / 12.
    (sum as f32 - 131_070.0) * (1.0 / 37_837.22)
}

/// A sequence of random numbers for building the scene, where order is fixed by the program.
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The sequence number `stream` of a seed.
    pub const fn new(seed: u64, stream: u64) -> Self {
        Self { state: hash(seed, stream) }
    }
    /// The next 64 bits.
    pub const fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.state)
    }
    /// Uniform in `[low, high)`.
    pub fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * unit(self.bits())
    }
    /// `true` with the given probability.
    pub fn chance(&mut self, probability: f32) -> bool {
        unit(self.bits()) < probability
    }
    /// Uniform in `0..count`; `count` must not be zero.
    pub const fn index(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }
    /// One of the items.
    pub fn pick<T: Copy, const N: usize>(&mut self, items: [T; N]) -> T {
        items[self.index(N)]
    }
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

    #[test]
    fn streams_of_a_seed_differ_and_repeat() {
        let take = |seed, stream| {
            let mut random = Random::new(seed, stream);
            [random.bits(), random.bits(), random.bits()]
        };
        assert_eq!(take(1, 2), take(1, 2));
        assert_ne!(take(1, 2), take(1, 3));
        assert_ne!(take(1, 2), take(2, 2));
    }
}
