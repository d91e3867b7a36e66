//! Seeded random numbers: the same on every machine and for every number of threads.
//!
//! `SplitMix64` (Steele et al., OOPSLA 2014) is written here, not taken from a crate: every simulated town, every trained
//! model and many tests depend on these exact numbers, and a crate may change its generator with any release.
//!
//! [`Random`] is a sequence. Parallel work takes one sequence for each item, [`Random::for_stream`], so that results do not depend on the
//! order in which threads run. [`hash()`], [`unit()`] and [`gauss`] are functions of a key, for values that belong to a place
//! and not to a sequence.
//!
//! The numbers of a seed never change: a different number changes towns, models and test data. There is no seed from the clock or the
//! system, and no generator that is shared by threads. This is not a source of secrets: keys of connections come from the operating
//! system (crate `link`).
//!
//! Where to start reading: this file has the sequences and distributions, `hash.rs` the functions of a key.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod hash;

pub use hash::{gauss, hash, mix, unit};

/// Increment of the state of `SplitMix64`.
const INCREMENT: u64 = 0x9e37_79b9_7f4a_7c15;

/// A sequence of random numbers, determined by its seed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The sequence of a seed: `SplitMix64` as published.
    pub const fn new(seed: u64) -> Self {
        Self { state: seed }
    }
    /// Sequence number `stream` of a seed, in the form used by trainings.
    pub const fn for_stream(seed: u64, stream: u64) -> Self {
        let first = Self::new(seed).bits();
        Self { state: first ^ stream.wrapping_mul(0xd6e8_feb8_6659_fd93) }
    }
    /// Sequence number `stream` of a seed, in the form used by simulated towns. Trainings and towns differ in this step for
    /// historical reasons only; models and towns depend on both.
    pub const fn for_hashed_stream(seed: u64, stream: u64) -> Self {
        Self { state: hash(seed, stream).wrapping_add(INCREMENT) }
    }
    /// The next 64 bits.
    #[inline]
    pub const fn bits(&mut self) -> u64 {
        let bits = mix(self.state);
        self.state = self.state.wrapping_add(INCREMENT);
        bits
    }
    /// Uniform in `[0, 1)`, in steps of 2^-24.
    #[inline]
    pub const fn unit(&mut self) -> f32 {
        unit(self.bits())
    }
    /// Uniform in `[low, high)`.
    #[inline]
    pub const fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }
    /// `true` with the given probability.
    #[inline]
    pub const fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }
    /// Uniform in `0..n`. `n` must not be zero.
    #[inline]
    pub const fn index(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    /// One of the items, which must not be empty.
    pub const fn pick<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.index(items.len())]
    }
    /// Mean 0, variance 1 (Box and Muller, Annals of Mathematical Statistics 1958).
    #[inline]
    pub fn gauss(&mut self) -> f32 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f32::consts::TAU * self.unit()).cos()
    }
    /// The numbers `0..n` in random order (Fisher and Yates).
    pub fn permutation(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, self.index(i + 1));
        }
        order
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_numbers_equal_the_published_reference() {
        // `splitmix64.c` by Vigna, seed 1234567.
        let mut random = Random::new(1_234_567);
        assert_eq!(random.bits(), 6_457_827_717_110_365_317);
        assert_eq!(random.bits(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn streams_of_a_seed_differ_and_repeat() {
        for stream_of in [Random::for_stream, Random::for_hashed_stream] {
            let take = |seed, stream| {
                let mut random = stream_of(seed, stream);
                [random.bits(), random.bits(), random.bits()]
            };
            assert_eq!(take(1, 2), take(1, 2));
            assert_ne!(take(1, 2), take(1, 3));
            assert_ne!(take(1, 2), take(2, 2));
        }
    }

    #[test]
    fn gauss_has_mean_zero_and_variance_one() {
        let mut random = Random::new(7);
        let samples: Vec<f64> = (0..100_000).map(|_| f64::from(random.gauss())).collect();
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / samples.len() as f64;
        assert!(mean.abs() < 0.015, "{mean}");
        assert!((variance - 1.0).abs() < 0.02, "{variance}");
    }

    #[test]
    fn permutation_contains_every_number_once() {
        let mut order = Random::new(3).permutation(100);
        assert_ne!(order, (0..100).collect::<Vec<_>>());
        order.sort_unstable();
        assert_eq!(order, (0..100).collect::<Vec<_>>());
    }
}
