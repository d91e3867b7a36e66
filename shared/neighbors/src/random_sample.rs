//! Random sampling.

use random::Random;

/// Samples `n` different numbers of `0..n_points` in random order, with equal probabilities; all numbers if `n` is
/// larger. The sample is determined by the seed; a longer sample begins with the shorter one.
pub fn random_sample(n_points: u32, n: usize, seed: u64) -> Vec<u32> {
    let mut random = Random::new(seed);
    let mut points: Vec<u32> = (0..n_points).collect();
    let n = n.min(points.len());
    // The first steps of Fisher and Yates.
    for chosen in 0..n {
        points.swap(chosen, chosen + random.index(n_points as usize - chosen));
    }
    points.truncate(n);
    points
}
